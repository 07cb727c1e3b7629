#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/yaw_observer.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// What a driver believes of the truck's steering.
struct SteeringEstimatorParameters {
  double dead_time;         ///< of the steering [s]
  double transport_delay;   ///< command to steering valve: cycle, bus, controller [s]
  double lag;               ///< of the steering, first order [s]
  double dead_band;         ///< full width, lost on a reversal of the command [rad]
  double lead;              ///< of the command before the articulation it will meet, at most [rad]
  double boost;             ///< added to the command sent where the lead is used up [rad]
  double max_rate;          ///< of the steering [rad/s]
  double max_articulation;  ///< highest command [rad]
  double rate_time;         ///< memory of the fastest rate [s]
  double rate_change;       ///< by which the fastest rate may be below max_rate [1]
  double bias_time;         ///< memory of the articulation sensor's bias [s]
  double max_bias;          ///< [rad]
  YawObserverParameters yaw;
};

/// Reads the maps `steering`, `fastest_rate`, `articulation_bias` and `yaw_response` of a driver's file.
/// Throws config::ConfigError.
SteeringEstimatorParameters loadSteeringEstimator(config::Node& node);

/// Keeps the commands that a driver gives and knows what they come to:
/// 1. learns the articulation sensor's bias against standing commands, how fast the articulation turns
///    where its command is out of reach, and how the truck's yaw rate answers the articulation
///    (YawObserver);
/// 2. tells which command acts at a time, after transport delay and dead time, and what articulation the
///    truck will have when a command given now begins to act.
/// Never throws, allocates nothing.
class SteeringEstimator {
 public:
  SteeringEstimator(const SteeringEstimatorParameters& parameters,
                    const vehicle::TruckGeometry& geometry);

  /// Takes a motion newer than the last one (an older one changes nothing); finite numbers only.
  void observe(const Motion& motion);

  /// The newest motion, its articulation freed of the bias. Must not be called before observe().
  const Motion& motion() const { return *last_motion_; }
  bool observed() const { return last_motion_.has_value(); }

  /// Articulation when a command given at `now` begins to act [rad].
  double articulationAhead(Stamp now) const;
  /// Command whose time to act includes `time` [rad].
  double commandActing(Stamp time) const { return commandGivenBefore(time - delay()); }
  double newestCommand() const { return given_[newest_].command; }

  /// Takes the command that a driver has found, held within `lead` of the articulation `meets` [rad]
  /// that it will meet, so that a driver takes over from where the truck stands while another one
  /// steers. Returns what to send: the command, what crosses the valve's dead band, and the boost [rad].
  double give(double command, double meets, Stamp now);

  /// Time since the last command, no more than a pause that it can bridge; 0 before the first one [s].
  double elapsed(Stamp now) const;
  Stamp delay() const;  ///< from a command given to the valve's answer
  YawResponse learned() const { return yaw_.response(); }
  double maxRate() const {
    return max_rate_;
  }  ///< the fastest the articulation turns, as learned [rad/s]

  void reset();

 private:
  struct Given {
    Stamp time{};
    double command = 0.0;
  };

  double commandGivenBefore(Stamp time) const;
  void learnMaxRate(double lead, double passed);
  void dropCommands(double articulation);

  SteeringEstimatorParameters parameters_;
  YawObserver yaw_;
  std::array<Given, 64> given_{};  ///< commands given, a ring
  std::size_t newest_ = 0;
  std::optional<Stamp> last_time_;       ///< of the last command
  std::optional<Motion> last_motion_;    ///< its articulation freed of the bias
  double commanded_articulation_ = 0.0;  ///< what the commands given should have made of it by now [rad]
  double max_rate_;                      ///< learned [rad/s]
  double out_of_reach_ = 0.0;            ///< time that the command has been so far ahead [s]
  double bias_ = 0.0;                    ///< of the measured articulation against the commands [rad]
  double play_ = 0.0;                    ///< added to the command to cross the dead band [rad]
};

}  // namespace tunnel_pilot::drivers
