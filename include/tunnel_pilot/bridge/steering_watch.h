#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// The articulation that a command history should have led to: dead time, then a rate limit, then a
/// first order lag (the order and numbers of SPECIFICATION 1.0, hydraulics):
///   r' = clamp((u(t - dead_time) - r) / dt, +-rate), gamma' = (r - gamma) / lag.
class SteeringResponse {
 public:
  SteeringResponse(double dead_time, double rate, double lag);

  /// Starts anew at rest at this angle [rad].
  void reset(double angle, Stamp now);

  /// Takes the angle that is being sent [rad] and advances to `now`; returns the expected angle [rad].
  double step(double sent, Stamp now);

 private:
  struct Sent {
    Stamp stamp;
    double angle;
  };

  /// More than are sent in any dead time (CommandSender): a step allocates nothing.
  static constexpr std::size_t kReserved = 64;

  Stamp dead_time_;
  double rate_;
  double lag_;
  std::vector<Sent> sent_;  ///< not yet effective, oldest first
  double demand_ = 0.0;     ///< effective now [rad]
  double ramp_ = 0.0;       ///< behind the rate limit [rad]
  double angle_ = 0.0;      ///< [rad]
  Stamp last_{};
};

/// Tells when the measured articulation does not follow what was sent (a stuck valve, a lost hose, a
/// valve that runs away). The pump gives between min_rate and max_rate, and no truck need be slower than
/// its data sheet: any angle between the two expectations and the angle sent is right; the error is the
/// distance to the interval that the three span.
class SteeringWatch {
 public:
  explicit SteeringWatch(const TrackingParameters& parameters);

  void reset(double measured, Stamp now);
  void step(double sent, double measured, Stamp now);

  double error() const { return error_; }  ///< [rad], 0 when as expected

  /// The error has been too large for too long.
  bool failed(Stamp now) const;

 private:
  double max_error_;
  Stamp max_time_;
  SteeringResponse fast_;
  SteeringResponse slow_;
  double error_ = 0.0;
  Stamp good_{};  ///< when the error was last small
};

}  // namespace tunnel_pilot::bridge
