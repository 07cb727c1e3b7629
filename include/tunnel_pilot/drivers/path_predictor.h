#pragma once

#include <optional>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/drivers/path_model.h"
#include "tunnel_pilot/drivers/steering_estimator.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// What a driver along a path believes of the truck, and how it filters what it is told.
struct PathPredictorParameters {
  double max_tunnel_age;   ///< an older tunnel is not driven on [s]
  double slip_compliance;  ///< tyre slip angle per lateral acceleration [rad s^2/m]
  double offset_time;      ///< memory of the offset filter [s]
  double heading_time;     ///< memory of the heading filter [s]
  SteeringEstimatorParameters steering;
};

/// Tells a driver where the truck will be beside its path when a command given now begins to act. Each
/// scan it
/// 1. filters offset and heading error: predicted by odometry from scan to scan, corrected by the scan;
/// 2. learns how the truck answers its steering (SteeringEstimator);
/// 3. brings the truck from the scan's time to now by odometry, and over the steering's dead time by the
///    truck's model (advancedOnPath) and the commands already given.
/// Never throws, allocates nothing.
class PathPredictor {
 public:
  PathPredictor(const PathPredictorParameters& parameters, const vehicle::TruckGeometry& geometry);

  /// `tunnel` is that of the newest scan, `motion` the newest feedback; both at or before `now`. None
  /// without a valid and fresh tunnel, without motion, from numbers that are not finite.
  std::optional<PathState> predict(const perception::Tunnel& tunnel, const Motion& motion, Stamp now);

  /// Takes the command that a driver has found for the place `start` of predict(); see
  /// SteeringEstimator::give().
  double give(double command, const PathState& start, Stamp now) {
    return steering_.give(command, start.articulation, now);
  }

  void reset();

  double elapsed(Stamp now) const { return steering_.elapsed(now); }  ///< since the last command [s]
  double footPoint() const { return last_errors_.s; }  ///< of the last scan on its centerline [m]
  YawResponse learned() const { return steering_.learned(); }
  const TruckResponse& truck() const { return truck_; }  ///< max_rate as learned

 private:
  struct Errors {
    double s, offset, heading;
  };
  bool usable(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) const;
  Errors filterErrors(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose);
  /// Errors after a movement `step` (in the truck's frame) beside a path of this curvature.
  Errors carried(const Errors& from, const geometry::Pose& step, double curvature) const;
  PathState overDeadTime(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose,
                         const Errors& errors, const Motion& motion, Stamp now) const;

  PathPredictorParameters parameters_;
  TruckResponse truck_;
  SteeringEstimator steering_;
  MotionHistory history_;

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
