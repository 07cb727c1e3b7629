#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/drivers/path_model.h"
#include "tunnel_pilot/drivers/yaw_observer.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// What a driver along a path believes of the truck, and how it filters what it is told.
struct PathPredictorParameters {
  double max_tunnel_age;    ///< an older tunnel is not driven on [s]
  double dead_time;         ///< of the steering [s]
  double transport_delay;   ///< command to steering valve: cycle, bus, controller [s]
  double lag;               ///< of the steering [s]
  double dead_band;         ///< full width, lost on a reversal of the command [rad]
  double lead;              ///< of the command before the articulation it will meet, at most [rad]
  double max_rate;          ///< of the steering [rad/s]
  double max_articulation;  ///< highest command [rad]
  double slip_compliance;   ///< tyre slip angle per lateral acceleration [rad s^2/m]
  double offset_time;       ///< memory of the offset filter [s]
  double heading_time;      ///< memory of the heading filter [s]
  double bias_time;         ///< memory of the articulation sensor's bias [s]
  double max_bias;          ///< [rad]
  YawObserverParameters yaw;
};

/// Tells a driver where the truck will be beside its path when a command given now begins to act, and
/// keeps the commands that it gives. Each scan it
/// 1. filters offset and heading error: predicted by odometry from scan to scan, corrected by the scan;
/// 2. learns the articulation sensor's bias against standing commands, and how the truck's yaw rate
///    answers the articulation (YawObserver);
/// 3. brings the truck from the scan's time to now by odometry, and over the steering's dead time by the
///    truck's model (advancedOnPath) and the commands already given.
/// Never throws, allocates nothing.
class PathPredictor {
 public:
  PathPredictor(const PathPredictorParameters& parameters, const vehicle::TruckGeometry& geometry);

  /// `tunnel` is that of the newest scan, `motion` the newest feedback; both at or before `now`. None
  /// without a valid and fresh tunnel, without motion, from numbers that are not finite.
  std::optional<PathState> predict(const perception::Tunnel& tunnel, const Motion& motion, Stamp now);

  /// Takes the command that a driver has found for the place `start` of predict(), held within `lead` of
  /// the articulation it will meet, so that a driver takes over from where the truck stands while
  /// another one steers. Returns what to send: the command and what crosses the valve's dead band [rad].
  double give(double command, const PathState& start, Stamp now);

  void reset();

  /// Time since the last command, no more than a pause that it can bridge; 0 before the first one [s].
  double elapsed(Stamp now) const;
  double footPoint() const { return last_errors_.s; }  ///< of the last scan on its centerline [m]
  YawResponse learned() const { return yaw_.response(); }
  const TruckResponse& truck() const { return truck_; }

 private:
  struct Errors {
    double s, offset, heading;
  };
  struct Given {
    Stamp time{};
    double command = 0.0;
  };

  bool usable(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) const;
  Errors filterErrors(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose);
  /// Errors after a movement `step` (in the truck's frame) beside a path of this curvature.
  Errors carried(const Errors& from, const geometry::Pose& step, double curvature, double elapsed,
                 double articulation) const;
  void learnFrom(const Motion& motion);
  PathState overDeadTime(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose,
                         const Errors& errors, const Motion& motion, Stamp now) const;
  double commandAt(Stamp time) const;
  void dropCommands(double articulation);
  Stamp delay() const;  ///< from a command given to the valve's answer

  PathPredictorParameters parameters_;
  TruckResponse truck_;
  YawObserver yaw_;
  MotionHistory history_;

  std::array<Given, 64> given_{};  ///< commands given, a ring
  std::size_t newest_ = 0;
  std::optional<Stamp> last_time_;       ///< of the last command
  std::optional<Motion> last_motion_;    ///< its articulation freed of the bias
  double commanded_articulation_ = 0.0;  ///< what the commands given should have made of it by now [rad]
  double bias_ = 0.0;                    ///< of the measured articulation against the commands [rad]
  double play_ = 0.0;                    ///< added to the command to cross the dead band [rad]

  std::optional<geometry::Pose> last_scan_pose_;  ///< odom
  Stamp last_scan_{};
  Errors last_errors_{};
};

/// Reads the parts of config/preview_driver.yaml that PathPredictorParameters hold. Throws
/// config::ConfigError.
PathPredictorParameters loadPathPredictor(config::Node& node);

/// 1 for a perfectly known place in the tunnel, 1/2 for standard deviations of 0.1 m or 0.05 rad.
double confidence(const perception::TunnelState& state);

}  // namespace tunnel_pilot::drivers
