#pragma once

#include <optional>

#include "tunnel_pilot/bridge/odometry_error.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/yaw_observer.h"
#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::bridge {

/// How the truck slips sideways.
struct SlipModel {
  double compliance;  ///< tyre slip angle per lateral acceleration, 1/(g_0 C) [rad s^2/m]
  drivers::YawObserverParameters yaw;  ///< how g is learned
};

/// Dead reckoning of base_link in the frame odom from the truck's own sensors.
///
/// Heading is integrated from the gyro less its bias, position from the speed along the mean course of
/// each step (midpoint rule). The course is the heading and the front axle's slip angle
///   beta = -v theta' / (g_0 C) + (g - 1) tan(gamma / 2):
/// the tyres' quasi-static one, with C their cornering coefficient, and what a yaw gain g other than 1
/// tells of the slip if both axles share it alike (drivers::YawObserver learns g). The kinematic yaw
/// rate (v sin(gamma) + l_r gamma')/(l_f cos(gamma) + l_r) (the paper's equation 2) serves twice:
///  - it teaches the gyro's bias, but only at standstill, where it is exact. While driving, the hinge
///    sensor's own bias of 0.3 deg would be worth 0.17 deg/s at 3 m/s, more than a gyro's drift;
///  - it stands in when there is no fresh gyro.
class Odometry {
 public:
  /// `bias_time` [s]: time constant of the bias; `standstill_speed` [m/s]: below it the truck stands.
  Odometry(const vehicle::TruckGeometry& truck, double bias_time, double standstill_speed,
           const SensorErrors& errors, const SlipModel& slip);

  /// Takes one measurement and advances to `now`. Angles [rad], rates [rad/s], speed [m/s].
  void update(double articulation, double articulation_rate, double speed, std::optional<double> gyro,
              Stamp now);

  /// The next update starts a new step: nothing is integrated across a clock that jumped.
  void forgetTime() { started_ = false; }

  const drivers::Motion& motion() const { return motion_; }
  double slip() const { return slip_; }           ///< beta, left of the heading [rad]
  double gyroBias() const { return gyro_bias_; }  ///< [rad/s]

  /// Covariance of motion().pose: x [m], y [m], heading [rad].
  Eigen::Matrix3d poseCovariance() const { return error_.pose(); }
  /// Variances of speed ahead, speed to the left [m^2/s^2] and yaw rate [rad^2/s^2], in base_link.
  Eigen::Vector3d twistVariance() const;

 private:
  double kinematicYawDeviation(double speed) const;
  double slipAngle() const;

  vehicle::TruckGeometry truck_;
  double bias_time_;
  double standstill_speed_;
  SensorErrors errors_;
  OdometryError error_;
  double slip_compliance_;
  drivers::YawObserver yaw_;
  drivers::Motion motion_;
  double slip_ = 0.0;
  double gyro_bias_ = 0.0;
  bool has_gyro_ = false;  // in the last update
  bool started_ = false;
};

}  // namespace tunnel_pilot::bridge
