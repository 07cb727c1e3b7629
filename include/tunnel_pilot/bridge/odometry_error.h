#pragma once

#include <Eigen/Core>
#include <optional>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::bridge {

/// Standard deviations of what dead reckoning is made from.
struct SensorErrors {
  double speed;         ///< of one reading [m/s]
  double speed_scale;   ///< of its scale, the tyre's radius [1]
  double slip;          ///< of the front body's direction of motion [rad]
  double yaw_rate;      ///< of one reading of the gyro [rad/s]
  double gyro_bias;     ///< of its bias before it was learnt [rad/s]
  double gyro_drift;    ///< of the bias after one second [rad/s/sqrt(s)]
  double articulation;  ///< of the hinge sensor's bias, which counts where there is no gyro [rad]
};

/// Throws config::ConfigError naming file, key, unit and range.
SensorErrors loadSensorErrors(config::Node node);

/// How far off the dead-reckoned pose may be: the linear propagation of the errors in x, y, heading, the
/// speed's scale and the gyro's bias. Scale and bias last, so that errors grow with the way and not with
/// its root, as white noise would have it. Slip varies over kSlipLength.
class OdometryError {
 public:
  static constexpr double kSlipLength = 5.0;  ///< [m]

  explicit OdometryError(const SensorErrors& errors);

  /// One step of `dt` [s] along `way` [m] in the direction `heading` [rad].
  void advance(double heading, double way, double dt, bool has_gyro, double kinematic_yaw_deviation);

  /// The gyro's bias takes over this share of a reading at standstill.
  void learnBias(double share);

  /// Of x [m], y [m], heading [rad], in the frame odom.
  Eigen::Matrix3d pose() const { return covariance_.topLeftCorner<3, 3>(); }
  double yawBiasVariance() const { return covariance_(kBias, kBias); }  ///< [rad^2/s^2]

 private:
  enum { kX, kY, kHeading, kScale, kBias, kStates };
  using Matrix = Eigen::Matrix<double, kStates, kStates>;

  SensorErrors errors_;
  Matrix covariance_ = Matrix::Zero();
};

}  // namespace tunnel_pilot::bridge
