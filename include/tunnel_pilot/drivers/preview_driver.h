#pragma once

#include <array>
#include <optional>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/drivers/preview_planner.h"
#include "tunnel_pilot/drivers/yaw_observer.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// What the driver believes of the truck, and how it weighs errors (config/preview_driver.yaml).
struct PreviewDriverParameters {
  double speed;           ///< highest speed asked for [m/s]
  double max_tunnel_age;  ///< an older tunnel is not driven on [s]
  double planning_speed;  ///< lowest speed planned with, so that standing trucks may steer [m/s]
  double preview_time;    ///< of the point shown as preview point [s]
  double step;            ///< of the plan; the horizon has PreviewPlanner::kStages of them [s]
  PreviewWeights weights;
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

/// Reads and checks config/preview_driver.yaml. Throws config::ConfigError.
PreviewDriverParameters loadPreviewDriver(config::Node node);

/// Drives along the measured centerline as a driver does who looks ahead (optimal preview). Each scan it
/// 1. filters offset and heading error: predicted by odometry from scan to scan, corrected by the scan;
/// 2. learns the articulation sensor's bias against standing commands, and how the truck's yaw rate
///    answers the articulation (YawObserver);
/// 3. brings the truck from the scan's time to now by odometry, and over the steering's dead time by the
///    truck's model and the commands already given;
/// 4. plans the command's rate over the horizon (PreviewPlanner) and commands its first moment.
/// While another one steers, the command stays within `lead` of the measured articulation, so that the
/// driver takes over from where it stands.
/// Invalid proposals: no valid or fresh tunnel, no motion, non-finite input. Never throws, allocates
/// nothing after construction.
class PreviewDriver {
 public:
  PreviewDriver(const PreviewDriverParameters& parameters, const vehicle::TruckGeometry& geometry);

  /// `tunnel` is that of the newest scan, `motion` the newest feedback; both at or before `now`.
  Proposal propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now);
  void reset();

  YawResponse learned() const { return yaw_.response(); }

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
  PathState predict(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose,
                    const Errors& errors, const Motion& motion, Stamp now) const;
  double commandAt(Stamp time) const;
  void give(double command, Stamp now);
  void dropCommands(double articulation);
  Stamp delay() const;  ///< from a command given to the valve's answer

  PreviewDriverParameters parameters_;
  PreviewPlanner planner_;
  YawObserver yaw_;
  MotionHistory history_;

  std::array<Given, 64> given_{};  ///< commands given, a ring
  std::size_t newest_ = 0;
  std::optional<Stamp> last_time_;       ///< of the last proposal
  std::optional<Motion> last_motion_;    ///< its articulation freed of the bias
  double commanded_articulation_ = 0.0;  ///< what the commands given should have made of it by now [rad]
  double bias_ = 0.0;                    ///< of the measured articulation against the commands [rad]
  double play_ = 0.0;                    ///< added to the command to cross the dead band [rad]

  std::optional<geometry::Pose> last_scan_pose_;  ///< odom
  Stamp last_scan_{};
  Errors last_errors_{};
};

}  // namespace tunnel_pilot::drivers
