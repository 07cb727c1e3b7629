#pragma once

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// Four-wheel drive and brakes of a truck that knows its payload: an acceleration a asks for the force
/// m a (rolling resistance and grade are not made up for, so that zero coasts). Force limits are those
/// that give the stated acceleration and deceleration on the flat, loaded, rolling resistance included.
/// First order lags. A governor takes the drive back toward the top speed. Brakes heat up and fade:
///   C T' = F_b |v| - C T / tau,   limit (1 - fade min(1, T / T_fade))
/// Forces [N], T [K] above the surroundings.
class DriveTrain {
 public:
  DriveTrain(const TruckParameters& parameters, Load load);

  /// Everything released; the brakes have this temperature.
  void reset(double brake_temperature);

  /// `acceleration` demanded [m/s^2], negative brakes; `speed` [m/s].
  void step(double acceleration, double speed, double dt);

  double driveForce() const { return drive_force_; }  ///< of both axles
  double brakeForce() const { return brake_force_; }  ///< magnitude, of both axles
  double brakeTemperature() const { return temperature_; }

 private:
  DriveAndBrakes parameters_;
  double mass_;
  double drive_limit_;
  double brake_limit_;
  double drive_force_ = 0.0;
  double brake_force_ = 0.0;
  double temperature_ = 0.0;
};

}  // namespace tunnel_pilot::vehicle
