#include "tunnel_pilot/drivers/yaw_observer.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::drivers {

YawObserverParameters loadYawObserver(config::Node node) {
  YawObserverParameters p{};
  p.gain = node.number("gain", "1", 0.5, 1.5);
  p.gain_deviation = node.number("gain_deviation", "1", 0.0, 0.5);
  p.disturbance_deviation = node.number("disturbance_deviation", "1/m", 0.0, 0.05);
  p.hinge_share = node.number("hinge_share", "1", 0.5, 1.2);
  p.memory = node.number("memory", "s", 1.0, 1000.0);
  p.noise = node.number("noise", "rad/s", 1e-3, 1.0);
  p.rate_noise = node.number("rate_noise", "1", 0.0, 2.0);
  p.least_speed = node.number("least_speed", "m/s", 0.1, 5.0);
  node.finish();
  return p;
}

YawObserver::YawObserver(const YawObserverParameters& parameters, const vehicle::TruckGeometry& geometry)
    : parameters_(parameters), geometry_(geometry) {
  reset();
}

void YawObserver::reset() {
  state_.setZero();
  covariance_ = Eigen::Vector2d(parameters_.gain_deviation * parameters_.gain_deviation,
                                parameters_.disturbance_deviation * parameters_.disturbance_deviation)
                    .asDiagonal();
}

void YawObserver::update(const Motion& motion, double elapsed) {
  if (!(motion.speed >= parameters_.least_speed) || !(elapsed > 0.0)) return;
  const double keep = std::exp(-elapsed / parameters_.memory);
  state_ *= keep;
  covariance_ *= keep * keep;
  const double fresh = 1.0 - keep * keep;
  covariance_(0, 0) += fresh * parameters_.gain_deviation * parameters_.gain_deviation;
  covariance_(1, 1) += fresh * parameters_.disturbance_deviation * parameters_.disturbance_deviation;

  const double arm =
      geometry_.front_axle_to_hinge * std::cos(motion.articulation) + geometry_.rear_axle_to_hinge;
  const double steady = motion.speed * std::sin(motion.articulation) / arm;
  const double turning =
      parameters_.hinge_share * geometry_.rear_axle_to_hinge * motion.articulation_rate / arm;
  const Eigen::Vector2d seen(steady, motion.speed);
  const double noise = parameters_.noise + parameters_.rate_noise * std::abs(turning);
  const Eigen::Vector2d spread = covariance_ * seen;
  const double variance = seen.dot(spread) + noise * noise;
  const double surprise = motion.yaw_rate - parameters_.gain * steady - turning - seen.dot(state_);
  state_ += spread * (surprise / variance);
  covariance_ -= spread * spread.transpose() / variance;
  const auto within = [](double value, double deviation) {
    return std::clamp(value, -2.0 * deviation, 2.0 * deviation);
  };
  state_[0] = within(state_[0], parameters_.gain_deviation);
  state_[1] = within(state_[1], parameters_.disturbance_deviation);
}

}  // namespace tunnel_pilot::drivers
