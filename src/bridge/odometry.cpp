#include "tunnel_pilot/bridge/odometry.h"

#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::bridge {

Odometry::Odometry(const vehicle::TruckGeometry& truck, double bias_time, double standstill_speed)
    : truck_(truck), bias_time_(bias_time), standstill_speed_(standstill_speed) {}

void Odometry::update(double articulation, double articulation_rate, double speed,
                      std::optional<double> gyro, Stamp now) {
  const double dt = started_ ? toSeconds(now - motion_.stamp) : 0.0;
  const double kinematic = vehicle::yawRate(truck_, speed, articulation, articulation_rate);
  if (gyro && std::abs(speed) < standstill_speed_) {
    gyro_bias_ += (*gyro - kinematic - gyro_bias_) * (1.0 - std::exp(-dt / bias_time_));
  }
  const double yaw_rate = gyro ? *gyro - gyro_bias_ : kinematic;

  const double turn = 0.5 * (motion_.yaw_rate + yaw_rate) * dt;
  const double way = 0.5 * (motion_.speed + speed) * dt;
  const double middle = motion_.pose.heading + 0.5 * turn;
  motion_.pose.x += way * std::cos(middle);
  motion_.pose.y += way * std::sin(middle);
  motion_.pose.heading = geometry::wrapAngle(motion_.pose.heading + turn);

  motion_.stamp = now;
  motion_.speed = speed;
  motion_.yaw_rate = yaw_rate;
  motion_.articulation = articulation;
  motion_.articulation_rate = articulation_rate;
  started_ = true;
}

}  // namespace tunnel_pilot::bridge
