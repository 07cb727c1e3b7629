#pragma once

#include <cstdint>
#include <string>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/articulation_profile.h"

namespace tunnel_pilot::supervision {

/// What holds the speed.
enum class SpeedLimit : std::uint8_t {
  kNone = 0,    ///< the highest speed configured
  kDriver = 1,  ///< the lowest speed that a source asks for
  kLateralAcceleration = 2,
  kArticulationRate = 3,
  kSight = 4,     ///< the truck must stop within what it sees
  kObstacle = 5,  ///< ... within the free distance
  kDegraded = 6,
  kStop = 7,
  kLimiter = 8,  ///< acceleration or jerk: on the way to the speed asked for
};
std::string toString(SpeedLimit limit);

struct SpeedGovernorParameters {
  double max_speed;                 ///< [m/s]
  double max_lateral_acceleration;  ///< [m/s^2]
  double max_articulation_rate;     ///< [rad/s]
  double rate_window;               ///< path over which the articulation's slope is averaged [m]
  double bend_deceleration;         ///< to slow down before a bend [m/s^2]
  double sight_deceleration;        ///< guaranteed: steepest descent, hot brakes [m/s^2]
  double reaction_time;             ///< from measurement to braking [s]
  double sight_reserve;             ///< between nose and the end of sight or an obstacle [m]
};

/// Reads and checks the governor's part of config/arbiter.yaml. Throws config::ConfigError.
SpeedGovernorParameters loadSpeedGovernor(config::Node node);

/// Highest speed for every driver:
///   v <= min( sqrt(a_max / |kappa|), gamma_dot_max / |d(gamma_ref)/ds| ) at each point of the visible
///   centerline, reached by braking at b after the reaction time t_r:
///     v <= -b t_r + sqrt((b t_r)^2 + v_point^2 + 2 b distance), and v <= v_point where it is reached;
///   and the sight-limited stopping speed, the same with v_point = 0 at the end of what is seen.
/// gamma_ref is the exact curvature inversion (ArticulationProfile); its slope is averaged over a
/// window, because steering may round off what the path does within it.
class SpeedGovernor {
 public:
  struct Limit {
    double speed;  ///< [m/s]
    SpeedLimit by;
  };

  explicit SpeedGovernor(const SpeedGovernorParameters& parameters) : parameters_(parameters) {}

  /// Limit by the path from arc length `s` on; max_speed (by kNone) where nothing limits.
  Limit alongPath(const drivers::ArticulationProfile& profile, double s) const;

  /// Speed from which the truck stops within `distance` [m] ahead of its nose.
  double stoppingWithin(double distance) const;

 private:
  double brakingTo(double speed, double distance, double deceleration) const;

  SpeedGovernorParameters parameters_;
};

}  // namespace tunnel_pilot::supervision
