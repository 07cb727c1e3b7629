#include "tunnel_pilot/supervision/steering_monitor.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::supervision {

void SteeringMonitor::start(double measured, Stamp now) {
  given_.fill({now, measured});
  expected_ = slow_ = measured;
  wrong_for_ = 0.0;
  last_ = now;
}

double SteeringMonitor::commandAt(Stamp time) const {
  for (std::size_t age = 0; age < given_.size(); ++age) {
    const Given& given = given_[(newest_ + given_.size() - age) % given_.size()];
    if (given.time <= time) return given.command;
  }
  return given_[(newest_ + 1) % given_.size()].command;  // the oldest
}

void SteeringMonitor::update(double command, double measured, double speed, Stamp now) {
  const double elapsed = toSeconds(now - last_);
  if (!(elapsed > 0.0)) return;
  last_ = now;
  newest_ = (newest_ + 1) % given_.size();
  given_[newest_] = {now, command};

  const double working = std::clamp(std::abs(speed) / steering_.working_speed, 0.0, 1.0);
  const double rate = steering_.idle_rate + working * (steering_.max_rate - steering_.idle_rate);
  const double share = 1.0 - std::exp(-elapsed / steering_.lag);
  const double wanted = commandAt(now - fromSeconds(steering_.dead_time));
  const auto follow = [&](double& answer, double most) {
    answer += std::clamp(share * (wanted - answer), -most * elapsed, most * elapsed);
  };
  follow(expected_, rate);
  follow(slow_, steering_.idle_rate);
  const auto [low, high] = std::minmax(expected_, slow_);
  const bool wrong = measured < low - tolerance_ || measured > high + tolerance_;
  wrong_for_ = wrong ? wrong_for_ + elapsed : 0.0;
}

}  // namespace tunnel_pilot::supervision
