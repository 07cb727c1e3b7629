#pragma once

#include <array>
#include <cstddef>

#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::supervision {

/// Watches that the articulation follows its command: the answer expected of healthy hydraulics (dead
/// time, rate limit, first-order lag; a 15 deg/s ramp lags 5 deg) is compared with the measured one.
/// What any pump between idle and working speed would give is healthy: a weak one is slow, not broken.
class SteeringMonitor {
 public:
  /// Outside of both answers by more than `tolerance` [rad] for `time` [s] is an error.
  SteeringMonitor(const vehicle::HydraulicSteering& steering, double tolerance, double time)
      : steering_(steering), tolerance_(tolerance), time_(time) {}

  /// Starts anew from the measured articulation [rad].
  void start(double measured, Stamp now);

  /// Once a cycle: the command let out [rad], what was measured [rad] at which speed [m/s].
  void update(double command, double measured, double speed, Stamp now);

  bool failed() const { return wrong_for_ > time_; }
  double expected() const { return expected_; }  ///< at the present speed [rad]

 private:
  struct Given {
    Stamp time{};
    double command = 0.0;
  };

  double commandAt(Stamp time) const;

  vehicle::HydraulicSteering steering_;
  double tolerance_;
  double time_;
  std::array<Given, 64> given_{};  ///< a ring
  std::size_t newest_ = 0;
  Stamp last_{};
  double expected_ = 0.0;
  double slow_ = 0.0;       ///< answer at the idle rate [rad]
  double wrong_for_ = 0.0;  ///< [s]
};

}  // namespace tunnel_pilot::supervision
