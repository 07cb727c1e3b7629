#pragma once

#include <cstdint>
#include <vector>

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// The steering cylinders from demand to their own angle gamma_a: dead time, then the valve's dead band
/// (a play of that width: after a reversal of the demand so much of it is lost), then the pump's flow
/// limit (rising from idle_rate at standstill to max_rate at working_speed), then a first-order lag.
/// Angles [rad].
class HydraulicActuator {
 public:
  HydraulicActuator(const HydraulicSteering& parameters, double max_articulation);

  /// At rest at this angle, with no demand on its way.
  void reset(double angle);

  /// `speed` of the truck [m/s]; `dt` at most 1 ms.
  void step(double demand, double speed, double dt);

  double angle() const { return angle_; }  ///< gamma_a
  double rate() const { return rate_; }    ///< [rad/s]

 private:
  double delayed(double demand, double dt);

  HydraulicSteering parameters_;
  double max_articulation_;
  std::vector<double> demands_;  // ring, one a millisecond
  std::int64_t dead_time_;       // [ns]
  std::int64_t now_ = 0;         // [ns]
  double valve_ = 0.0;           // after dead band and flow limit
  double angle_ = 0.0;
  double rate_ = 0.0;
};

}  // namespace tunnel_pilot::vehicle
