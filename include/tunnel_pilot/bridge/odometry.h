#pragma once

#include <optional>

#include "tunnel_pilot/bridge/odometry_error.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::bridge {

/// Dead reckoning of base_link in the frame odom from the truck's own sensors.
///
/// Heading is integrated from the gyro less its bias, position from the speed along the mean heading of
/// each step (midpoint rule). The kinematic yaw rate (v sin(gamma) + l_r gamma')/(l_f cos(gamma) + l_r)
/// (the paper's equation 2) serves twice:
///  - it teaches the gyro's bias, but only at standstill, where it is exact. While driving, the hinge
///    sensor's own bias of 0.3 deg would be worth 0.17 deg/s at 3 m/s, more than a gyro's drift;
///  - it stands in when there is no fresh gyro.
class Odometry {
 public:
  /// `bias_time` [s]: time constant of the bias; `standstill_speed` [m/s]: below it the truck stands.
  Odometry(const vehicle::TruckGeometry& truck, double bias_time, double standstill_speed,
           const SensorErrors& errors);

  /// Takes one measurement and advances to `now`. Angles [rad], rates [rad/s], speed [m/s].
  void update(double articulation, double articulation_rate, double speed, std::optional<double> gyro,
              Stamp now);

  /// The next update starts a new step: nothing is integrated across a clock that jumped.
  void forgetTime() { started_ = false; }

  const drivers::Motion& motion() const { return motion_; }
  double gyroBias() const { return gyro_bias_; }  ///< [rad/s]

  /// Covariance of motion().pose: x [m], y [m], heading [rad].
  Eigen::Matrix3d poseCovariance() const { return error_.pose(); }
  /// Variances of speed ahead, speed to the left [m^2/s^2] and yaw rate [rad^2/s^2], in base_link.
  Eigen::Vector3d twistVariance() const;

 private:
  double kinematicYawDeviation(double speed) const;

  vehicle::TruckGeometry truck_;
  double bias_time_;
  double standstill_speed_;
  SensorErrors errors_;
  OdometryError error_;
  drivers::Motion motion_;
  double gyro_bias_ = 0.0;
  bool has_gyro_ = false;  // in the last update
  bool started_ = false;
};

}  // namespace tunnel_pilot::bridge
