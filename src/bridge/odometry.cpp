#include "tunnel_pilot/bridge/odometry.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::bridge {

Odometry::Odometry(const vehicle::TruckGeometry& truck, double bias_time, double standstill_speed,
                   const SensorErrors& errors, const SlipModel& slip)
    : truck_(truck),
      bias_time_(bias_time),
      standstill_speed_(standstill_speed),
      errors_(errors),
      error_(errors),
      slip_compliance_(slip.compliance),
      yaw_(slip.yaw, truck) {}

void Odometry::update(double articulation, double articulation_rate, double speed,
                      std::optional<double> gyro, Stamp now) {
  const double dt = started_ ? toSeconds(now - motion_.stamp) : 0.0;
  const double kinematic = vehicle::yawRate(truck_, speed, articulation, articulation_rate);
  if (gyro && std::abs(speed) < standstill_speed_) {
    const double share = 1.0 - std::exp(-dt / bias_time_);
    gyro_bias_ += (*gyro - kinematic - gyro_bias_) * share;
    error_.learnBias(share);
  }
  const double yaw_rate = gyro ? *gyro - gyro_bias_ : kinematic;

  const double turn = 0.5 * (motion_.yaw_rate + yaw_rate) * dt;
  const double way = 0.5 * (motion_.speed + speed) * dt;
  const double slip_before = slip_;
  motion_.stamp = now;
  motion_.speed = speed;
  motion_.yaw_rate = yaw_rate;
  motion_.articulation = articulation;
  motion_.articulation_rate = articulation_rate;
  if (gyro) yaw_.update(motion_, dt);
  slip_ = slipAngle();
  const double middle = motion_.pose.heading + 0.5 * (turn + slip_before + slip_);
  error_.advance(middle, way, dt, gyro.has_value(), kinematicYawDeviation(speed));
  motion_.pose.x += way * std::cos(middle);
  motion_.pose.y += way * std::sin(middle);
  motion_.pose.heading = geometry::wrapAngle(motion_.pose.heading + turn);

  has_gyro_ = gyro.has_value();
  started_ = true;
}

double Odometry::slipAngle() const {
  return -slip_compliance_ * motion_.speed * motion_.yaw_rate +
         (yaw_.response().gain - 1.0) * std::tan(0.5 * motion_.articulation);
}

// The hinge sensor's bias, as a yaw rate on a straight way.
double Odometry::kinematicYawDeviation(double speed) const {
  return std::abs(speed) * errors_.articulation /
         (truck_.front_axle_to_hinge + truck_.rear_axle_to_hinge);
}

Eigen::Vector3d Odometry::twistVariance() const {
  const auto square = [](double x) { return x * x; };
  const double speed = motion_.speed;
  const double reading = square(errors_.speed);
  const double yaw = has_gyro_ ? square(errors_.yaw_rate) + error_.yawBiasVariance()
                               : square(kinematicYawDeviation(speed));
  return {reading + square(errors_.speed_scale * speed), reading + square(errors_.slip * speed),
          std::max(yaw, square(errors_.yaw_rate))};
}

}  // namespace tunnel_pilot::bridge
