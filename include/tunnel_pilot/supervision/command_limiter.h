#pragma once

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::supervision {

struct CommandLimiterParameters {
  double max_articulation;          ///< [rad]
  double max_articulation_rate;     ///< [rad/s]
  double max_lateral_acceleration;  ///< [m/s^2]
  double max_speed;                 ///< [m/s]
  double max_acceleration;          ///< speeding up [m/s^2]
  double max_deceleration;          ///< slowing down [m/s^2]
  double max_jerk;                  ///< of the speed [m/s^3]
  double stop_deceleration;         ///< a stop's, which no jerk limit delays [m/s^2]
};

/// Reads and checks the limiter's part of config/arbiter.yaml. Throws config::ConfigError.
CommandLimiterParameters loadCommandLimiter(config::Node node);

/// The last stage before the way out. Limits, in this order:
///   finite:  a non-finite request holds the articulation, or asks for speed 0;
///   angle:   |gamma| <= max_articulation;
///   lateral acceleration: v^2 |kappa(gamma)| <= a_max, with kappa = sin(gamma)/(l_f cos(gamma) + l_r)
///            and v the higher of the measured and the commanded speed;
///   rate:    |d(gamma)/dt| <= max_articulation_rate. As the last stage it holds always; where it delays
///            the angle, the speed is lowered to keep the lateral acceleration, as braking allows;
///   speed:   0 <= v <= max_speed, acceleration and deceleration, jerk.
/// What lies inside all limits passes untouched. A stop's speed is 0 at once: the truck brakes as it
/// can.
class CommandLimiter {
 public:
  struct Request {
    double articulation;    ///< [rad]
    double speed;           ///< [m/s]
    double measured_speed;  ///< [m/s]
    bool stop;
  };
  struct Flags {
    bool not_finite = false, angle = false, lateral_acceleration = false, rate = false, speed = false,
         acceleration = false, jerk = false;
  };
  struct Result {
    double articulation = 0.0;  ///< [rad]
    double speed = 0.0;         ///< [m/s]
    double acceleration = 0.0;  ///< highest magnitude of speed change wanted [m/s^2]
    Flags fired;
  };

  CommandLimiter(const CommandLimiterParameters& parameters, const vehicle::TruckGeometry& geometry);

  /// `elapsed` [s] since the last call, negative or non-finite counts as 0; a pause beyond 0.1 s allows
  /// no larger step.
  Result limit(const Request& request, double elapsed);

  /// What the next output starts from: the truck's own articulation [rad] and speed [m/s].
  void start(double articulation, double speed);

  double articulation() const { return articulation_; }

 private:
  double limitAngle(const Request& request, double elapsed, Flags& fired);
  double limitSpeed(const Request& request, double elapsed, Flags& fired);

  CommandLimiterParameters parameters_;
  vehicle::TruckGeometry geometry_;
  double articulation_ = 0.0;  ///< last output [rad]
  double speed_ = 0.0;         ///< [m/s]
  double acceleration_ = 0.0;  ///< [m/s^2]
};

}  // namespace tunnel_pilot::supervision
