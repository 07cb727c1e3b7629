#include "tunnel_pilot/bridge/odometry_error.h"

#include <cmath>

namespace tunnel_pilot::bridge {
namespace {

double square(double x) { return x * x; }

}  // namespace

SensorErrors loadSensorErrors(config::Node node) {
  SensorErrors e{};
  e.speed = node.number("speed", "m/s", 0.0, 1.0);
  e.speed_scale = node.number("speed_scale", "1", 0.0, 0.2);
  e.slip = node.number("slip", "rad", 0.0, 0.2);
  e.yaw_rate = node.number("yaw_rate", "rad/s", 0.0, 0.1);
  e.gyro_bias = node.number("gyro_bias", "rad/s", 0.0, 0.1);
  e.gyro_drift = node.number("gyro_drift", "rad/s/sqrt(s)", 0.0, 0.01);
  e.articulation = node.number("articulation", "rad", 0.0, 0.1);
  node.finish();
  return e;
}

OdometryError::OdometryError(const SensorErrors& errors) : errors_(errors) {
  covariance_(kScale, kScale) = square(errors.speed_scale);
  covariance_(kBias, kBias) = square(errors.gyro_bias);
}

void OdometryError::advance(double heading, double way, double dt, bool has_gyro,
                            double kinematic_yaw_deviation) {
  const double c = std::cos(heading), s = std::sin(heading);
  Matrix step = Matrix::Identity();
  step(kX, kHeading) = -way * s;
  step(kY, kHeading) = way * c;
  step(kX, kScale) = way * c;
  step(kY, kScale) = way * s;
  if (has_gyro) step(kHeading, kBias) = dt;
  covariance_ = (step * covariance_ * step.transpose()).eval();

  const double along = square(errors_.speed * dt);
  const double across = square(errors_.slip) * std::abs(way) * kSlipLength;
  covariance_(kX, kX) += c * c * along + s * s * across;
  covariance_(kY, kY) += s * s * along + c * c * across;
  covariance_(kX, kY) += c * s * (along - across);
  covariance_(kY, kX) += c * s * (along - across);
  covariance_(kBias, kBias) += square(errors_.gyro_drift) * dt;
  if (has_gyro) {
    covariance_(kHeading, kHeading) += square(errors_.yaw_rate * dt);
  } else {  // a bias that lasts: deviations add up, not variances
    const double deviation = std::sqrt(covariance_(kHeading, kHeading));
    covariance_(kHeading, kHeading) = square(deviation + kinematic_yaw_deviation * dt);
  }
}

void OdometryError::learnBias(double share) {
  covariance_.row(kBias) *= 1.0 - share;
  covariance_.col(kBias) *= 1.0 - share;
  covariance_(kBias, kBias) += square(share * errors_.yaw_rate);
}

}  // namespace tunnel_pilot::bridge
