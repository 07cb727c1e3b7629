#include "tunnel_pilot/bridge/steering_watch.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::bridge {

SteeringResponse::SteeringResponse(double dead_time, double rate, double lag)
    : dead_time_(fromSeconds(dead_time)), rate_(rate), lag_(lag) {
  sent_.reserve(kReserved);
}

void SteeringResponse::reset(double angle, Stamp now) {
  sent_.clear();
  demand_ = ramp_ = angle_ = angle;
  last_ = now;
}

double SteeringResponse::step(double sent, Stamp now) {
  if (sent_.empty() || sent_.back().angle != sent) sent_.push_back({now, sent});
  while (sent_.front().stamp + dead_time_ <= now) {
    demand_ = sent_.front().angle;
    // The newest stays, so that an unchanged angle is not stored again and again.
    if (sent_.size() == 1) break;
    sent_.erase(sent_.begin());
  }
  const double dt = toSeconds(now - last_);
  last_ = now;
  ramp_ += std::clamp(demand_ - ramp_, -rate_ * dt, rate_ * dt);
  angle_ += (ramp_ - angle_) * (1.0 - std::exp(-dt / lag_));
  return angle_;
}

SteeringWatch::SteeringWatch(const TrackingParameters& parameters)
    : max_error_(parameters.max_error),
      max_time_(fromSeconds(parameters.max_time)),
      fast_(parameters.dead_time, parameters.max_rate, parameters.lag),
      slow_(parameters.dead_time, parameters.min_rate, parameters.lag) {}

void SteeringWatch::reset(double measured, Stamp now) {
  fast_.reset(measured, now);
  slow_.reset(measured, now);
  error_ = 0.0;
  good_ = now;
}

void SteeringWatch::step(double sent, double measured, Stamp now) {
  const auto [low, high] = std::minmax({sent, fast_.step(sent, now), slow_.step(sent, now)});
  error_ = std::max({low - measured, measured - high, 0.0});
  if (error_ <= max_error_) good_ = now;
}

bool SteeringWatch::failed(Stamp now) const { return now - good_ > max_time_; }

}  // namespace tunnel_pilot::bridge
