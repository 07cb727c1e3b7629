#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/articulation_profile.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/drivers/yaw_observer.h"
#include "tunnel_pilot/perception/types.h"
#include "tunnel_pilot/supervision/command.h"
#include "tunnel_pilot/supervision/command_limiter.h"
#include "tunnel_pilot/supervision/envelope.h"
#include "tunnel_pilot/supervision/speed_governor.h"
#include "tunnel_pilot/supervision/steering_monitor.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::supervision {

/// One row of the arbiter's table.
struct SourceRule {
  Source source;
  int priority;           ///< the highest healthy one steers
  double max_age;         ///< since its proposal was received [s]
  double min_confidence;  ///< less sure, it is not healthy [1]
  bool steers;
  bool gives_speed;  ///< the lowest speed of all healthy sources wins
};

/// config/arbiter.yaml.
struct ArbiterParameters {
  std::vector<SourceRule> sources;
  bool needs_truck_state;       ///< false: a truck without the bridge, taken as engaged from the start
  bool wall_checks;             ///< false only where there are no walls (lane-change experiments)
  double max_stamp_age;         ///< of a proposal's measurement [s]
  double max_future;            ///< of any stamp [s]
  double scan_degraded_age;     ///< without a new scan: slowly [s]
  double scan_stop_age;         ///< ... stop [s]
  double motion_stop_age;       ///< [s]
  double truck_state_stop_age;  ///< [s]
  double tunnel_grace;          ///< without a valid tunnel: slowly, then stop [s]
  double recovery_time;         ///< of health before driving fast again [s]
  double degraded_speed;        ///< [m/s]
  double dead_reckoning_age;    ///< oldest centerline a stop is steered along [s]
  int wall_scans;      ///< one after the other must show too little room to stop; it brakes at once
  int obstacle_scans;  ///< one after the other must show an obstacle to slow down or stop
  double tracking_tolerance;  ///< articulation from its expected answer [rad]
  double tracking_time;       ///< [s]
  int limit_hits;             ///< of angle or lateral acceleration within recovery_time: slowly
  double disagreement_angle;  ///< between lidar and preview driver: slowly [rad]
  double disagreement_time;   ///< that it lasts [s]
  double clock_jump;          ///< a pause of the clock beyond this is a jump [s]
  SpeedGovernorParameters governor;
  drivers::YawObserverParameters yaw;
  EnvelopeParameters envelope;
  CommandLimiterParameters limiter;
};

/// Reads and checks config/arbiter.yaml. Throws config::ConfigError.
ArbiterParameters loadArbiter(config::Node node);

/// The truck's side of engagement, from the bridge.
struct TruckState {
  bool engaged = false;   ///< ACTIVE or DEGRADED: the truck obeys
  bool stopping = false;  ///< STOPPING or STOPPED
  Reason reason = Reason::kNotEngaged;
};

/// A scan that the scan filter did not accept.
struct ScanRejection {
  bool frozen = false;  ///< the lidar repeats the same scan
};

/// What the arbiter lets out, and why.
struct Decision {
  Command command;
  bool degraded = false;  ///< driving slowly because of command.reason
  Source speed_source = Source::kNone;
  double speed_limit = 0.0;  ///< the governor's [m/s]
  SpeedLimit limited_by = SpeedLimit::kStop;
  double clearance_left = 0.0;  ///< [m], NaN unknown
  double clearance_right = 0.0;
  double free_distance = 0.0;                  ///< [m]
  double stopping_distance = 0.0;              ///< [m]
  std::vector<geometry::Point> corridor_left;  ///< in base_link of the scan [m]
  std::vector<geometry::Point> corridor_right;
  CommandLimiter::Flags limits;
};

/// How grave a reason is: the gravest of those found is told.
int gravity(Reason reason);

/// The one way out for commands. Each decision:
///   1. assesses every input's age and health: findings that slow down, findings that stop;
///   2. chooses who steers: the healthy source of highest priority; with none, the last measured
///      centerline by dead reckoning; without odometry the articulation is held;
///   3. chooses the speed: the lowest of all healthy sources', the governor's, the sight's;
///   4. checks the swept corridor against the stopping distance;
///   5. limits (CommandLimiter), and tells one reason.
/// A stop is latched while engaged: it ends when the truck's state says neither engaged nor stopping (an
/// operator's reset), or by reset() for a truck without states. A command with a reason but without stop
/// means degraded driving, or not being engaged; with stop before engagement it says what is not ready.
/// Inputs may come in any order or not at all; nothing throws; time is always an argument.
class Arbiter {
 public:
  Arbiter(const ArbiterParameters& parameters, const vehicle::TruckParameters& truck);

  const ArbiterParameters& parameters() const { return parameters_; }

  void setProposal(Source source, const drivers::Proposal& proposal, Stamp now);
  /// A scan came and was not accepted. It changes no limit, only which words tell that none is accepted.
  void setRejection(const ScanRejection& rejection, Stamp now);
  void setWalls(const perception::Walls& walls, Stamp now);
  void setTunnel(const perception::Tunnel& tunnel, Stamp now);
  /// False: it is refused, because it is not usable (drivers::isUsable), which stops the truck, or
  /// because its stamp lies farther ahead of `now` than max_future. When the pose before cannot have
  /// led to this one, the walls passed are forgotten, as at a start: the odom frame is another one.
  bool setMotion(const drivers::Motion& motion, Stamp now);
  /// How often a pose came to which the one before cannot have led.
  std::uint32_t odometryJumps() const { return odometry_jumps_; }
  void setTruckState(const TruckState& state, Stamp now);

  /// Returns of an accepted scan, in scan order, in base_link: any range of points with x and y members
  /// (pcl::PointCloud<pcl::PointXYZ>). They tell that the lidar lives.
  template <typename Cloud>
  void setPoints(const Cloud& points, Stamp stamp, Stamp now) {
    points_.clear();
    for (const auto& p : points) points_.emplace_back(p.x, p.y);
    takeScan(stamp, now);
  }

  /// Which of the drivers `lidar_driver` and `preview_driver` steers while healthy: with the second the
  /// first is left out of the table, neither steers nor slows down. Between the two the limiter leads
  /// over. False when the table has no such driver that steers.
  bool selectDriver(Source driver);

  /// The operator's stop: latched, whatever the state.
  void requestStop(Stamp now);
  /// Ends a latched stop. Refused (false) while the truck moves or a finding stops it.
  bool reset(Stamp now);
  /// Forgets everything measured; stops if engaged.
  void clockJumped();

  /// Takes other values for the numbers of arbiterTunables() from the next decision on, all at once.
  /// They must have been checked (config::Tuning).
  void tune(const std::vector<double>& values);
  /// Numbers may be loosened: the truck's state was heard lately and is neither engaged nor stopping. A
  /// truck without states counts as engaged.
  bool mayLoosen(Stamp now) const;

  /// The command for now. Call it on every proposal and on a timer of at least 50 Hz.
  const Decision& decide(Stamp now);

 private:
  struct Slot {
    drivers::Proposal proposal;
    std::optional<Stamp> received;
  };
  enum class Health { kNever, kStale, kInvalid, kUnable, kUnsure, kHealthy };
  /// How far the corridor ahead is free, and what ends it.
  struct FreeWay {
    double distance;  ///< [m]
    Envelope::End until;
  };

  struct Steering {
    Source source = Source::kHold;
    double articulation = 0.0;
    Stamp stamp{};
  };
  struct Speed {
    double value = 0.0;
    Source source = Source::kNone;
    SpeedLimit by = SpeedLimit::kNone;
  };
  /// The gravest finding of each kind.
  struct Findings {
    Reason stop = Reason::kNone;
    Reason slow = Reason::kNone;
    void stopFor(Reason reason);
    void slowFor(Reason reason);
  };

  /// What was seen, and when by the clock: forgotten when it jumps.
  struct Seen {
    std::array<Slot, 9> slots;  ///< by Source
    std::optional<Stamp> scan_received, rejection_received;
    std::optional<Stamp> gap_ended;  ///< when the last scan that was late came
    std::optional<Stamp> latched_at;
    std::optional<Stamp> tunnel_received, tunnel_valid_received;
    std::optional<Stamp> motion_received;
    std::optional<Stamp> truck_state_received;
    std::optional<Stamp> disagree_since;  ///< lidar and preview driver
    std::optional<Stamp> corridor_stamp;  ///< of the scan last compared
    int obstructed_scans = 0;             ///< one after the other, by obstacle or wall
    int obstacle_scans = 0;               ///< ... by an obstacle
    std::optional<Stamp> last;            ///< decision
    std::optional<Stamp> slow_until;
    std::optional<Stamp> wait_until;
    int hits = 0;  ///< of the limits
    std::optional<Stamp> last_hit;
  };

  void takeScan(Stamp stamp, Stamp now);
  void forgetPlaces();
  void watchClock(Stamp now);
  Health health(const SourceRule& rule, Stamp now) const;
  bool engaged() const;
  bool motionHealthy(Stamp now) const;
  Reason whyNoScan(Stamp now) const;
  void assessScan(Stamp now, Findings& findings) const;
  void assessTunnel(Stamp now, Findings& findings) const;
  void assessMotion(Stamp now, Findings& findings) const;
  void assessTruck(Stamp now, Findings& findings) const;
  bool waitsForScan(const SourceRule& rule, Stamp now) const;
  void assessSources(Stamp now, Findings& findings) const;
  void assessConfidence(Stamp now, Findings& findings) const;
  Findings assess(Stamp now) const;
  const SourceRule* bestSource(Stamp now) const;
  const drivers::Proposal* healthyProposal(Source source, Stamp now) const;
  void compareDrivers(Stamp now);
  Steering chooseSteering(Stamp now) const;
  std::optional<Steering> deadReckoning(Stamp now) const;
  std::optional<geometry::Pose> placeInCenterline(Stamp now) const;
  Speed chooseSpeed(Stamp now);
  Speed waitForFreeWay(const Speed& speed, Stamp now);
  bool slowNow(Reason found, Stamp now);
  FreeWay freeWay() const;
  void updateCorridor(double commanded, Stamp now);
  void tellCorridor();
  void latch(Findings& findings, Stamp now);
  Reason reasonOf(Reason stop, const Speed& speed) const;
  void letOut(const Steering& steering, const Speed& speed, bool stop, Stamp now);
  void watchLimits(const CommandLimiter::Flags& fired, Stamp now);

  ArbiterParameters parameters_;
  std::vector<SourceRule> all_sources_;  ///< parameters_ holds those that were not left out
  vehicle::TruckParameters truck_;
  SpeedGovernor governor_;
  Envelope envelope_;
  CommandLimiter limiter_;
  drivers::YawObserver yaw_;
  double slip_compliance_;  ///< of the front tyres [rad s^2/m]
  SteeringMonitor steering_monitor_;
  drivers::MotionHistory history_;

  Seen seen_;
  perception::Walls walls_;
  std::vector<geometry::Point> points_;
  perception::TunnelState tunnel_state_;  ///< newest
  geometry::Path centerline_;             ///< the last valid one
  drivers::ArticulationProfile profile_;  ///< of the centerline
  drivers::ArticulationProfile no_profile_;
  std::optional<geometry::Pose> centerline_pose_;  ///< its frame in odom
  Stamp points_stamp_{};
  ScanRejection rejection_;  ///< the last
  bool motion_usable_ = true;
  std::uint32_t odometry_jumps_ = 0;
  TruckState truck_state_;
  bool standby_seen_ = false;  ///< the truck was neither engaged nor stopping once

  std::vector<FreeWay> free_ways_;  ///< of the last obstacle_scans scans, less what was driven since
  Reason obstruction_ = Reason::kObstacle;

  Decision decision_;
  bool started_ = false;  ///< the limiter knows where the articulation stands
  std::optional<Reason> latched_;
  Reason slow_reason_ = Reason::kNone;
  SpeedLimit waits_for_ = SpeedLimit::kNone;  ///< what the truck stands before
};

}  // namespace tunnel_pilot::supervision
