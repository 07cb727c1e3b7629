#include "tunnel_pilot/supervision/arbiter.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::supervision {
namespace {

constexpr double kProfileSpacing = 0.5;  // [m]
constexpr double kStanding = 0.05;       // [m/s]
constexpr double kGravity = 9.81;        // [m/s^2]

double age(const std::optional<Stamp>& since, Stamp now) {
  return since ? toSeconds(now - *since) : std::numeric_limits<double>::infinity();
}

bool isPossible(const drivers::Proposal& proposal) {
  return std::isfinite(proposal.articulation_angle) && std::isfinite(proposal.speed) &&
         std::abs(proposal.articulation_angle) < M_PI_2 && proposal.speed >= 0.0;
}

}  // namespace

int gravity(Reason reason) {
  constexpr std::array<Reason, 27> kRising = {
      Reason::kNotEngaged,       Reason::kStartUp,          Reason::kOperatorRelease,
      Reason::kLimitsHit,        Reason::kDriversDisagree,  Reason::kLowConfidence,
      Reason::kNoSource,         Reason::kSourceStale,      Reason::kProposalInvalid,
      Reason::kTunnelInvalid,    Reason::kClearance,        Reason::kObstacle,
      Reason::kScanRejected,     Reason::kScanFrozen,       Reason::kScanStale,
      Reason::kSpeedImplausible, Reason::kMotionStale,      Reason::kCommandStale,
      Reason::kProcessSilent,    Reason::kTrackingError,    Reason::kFeedbackCorrupt,
      Reason::kFeedbackStale,    Reason::kBusFault,         Reason::kTruckFault,
      Reason::kClockJump,        Reason::kOperatorOverride, Reason::kOperatorStop};
  const auto place = std::find(kRising.begin(), kRising.end(), reason);
  return place == kRising.end() ? 0 : static_cast<int>(place - kRising.begin()) + 1;
}

void Arbiter::Findings::stopFor(Reason reason) {
  if (gravity(reason) > gravity(stop)) stop = reason;
}

void Arbiter::Findings::slowFor(Reason reason) {
  if (gravity(reason) > gravity(slow)) slow = reason;
}

Arbiter::Arbiter(const ArbiterParameters& parameters, const vehicle::TruckParameters& truck)
    : parameters_(parameters),
      all_sources_(parameters.sources),
      truck_(truck),
      governor_(parameters.governor),
      envelope_(parameters.envelope, parameters.limiter, truck.geometry),
      limiter_(parameters.limiter, truck.geometry),
      yaw_(parameters.yaw, truck.geometry),
      slip_compliance_(1.0 / (kGravity * truck.tyre.cornering_coefficient)),
      steering_monitor_(truck.steering, parameters.tracking_tolerance, parameters.tracking_time),
      history_(fromSeconds(parameters.max_future)) {}

// ---- inputs

void Arbiter::setProposal(Source source, const drivers::Proposal& proposal, Stamp now) {
  seen_.slots.at(static_cast<std::size_t>(source)) = {proposal, now};
}

void Arbiter::setRejection(const ScanRejection& rejection, Stamp now) {
  rejection_ = rejection;
  seen_.rejection_received = now;
}

void Arbiter::setWalls(const perception::Walls& walls, Stamp) { walls_ = walls; }

void Arbiter::takeScan(Stamp stamp, Stamp now) {
  if (age(seen_.scan_received, now) > parameters_.scan_degraded_age) seen_.gap_ended = now;
  points_stamp_ = stamp;
  seen_.scan_received = now;
}

void Arbiter::setTunnel(const perception::Tunnel& tunnel, Stamp now) {
  tunnel_state_ = tunnel.state;
  seen_.tunnel_received = now;
  if (!tunnel.state.valid || tunnel.centerline.empty()) return;
  const std::optional<geometry::Pose> pose = history_.poseAt(tunnel.state.stamp);
  seen_.tunnel_valid_received = now;
  centerline_ = tunnel.centerline;
  centerline_pose_ = pose;
  profile_.build(centerline_, truck_.geometry, kProfileSpacing);
}

bool Arbiter::setMotion(const drivers::Motion& motion, Stamp now) {
  motion_usable_ = drivers::isUsable(motion);
  if (!motion_usable_) return false;
  const Stamp last = history_.empty() ? motion.stamp : history_.latest().stamp;
  if (!history_.empty() && motion.stamp <= last) return true;  // nothing new, and no sign of life
  const bool jumped = !history_.empty() && !drivers::leadsTo(history_.latest(), motion);
  if (!history_.add(motion, now)) return false;
  if (jumped) forgetPlaces();
  odometry_jumps_ += jumped ? 1 : 0;
  if (motion.stamp > last) yaw_.update(motion, toSeconds(motion.stamp - last));
  seen_.motion_received = now;
  return true;
}

// All that is kept in the odom frame, when that frame is another one: as at a start. Older poses would
// bring scans that are still under way into a frame between the two.
void Arbiter::forgetPlaces() {
  history_.keepLatest();
  envelope_.reset();
  centerline_pose_.reset();
}

void Arbiter::setTruckState(const TruckState& state, Stamp now) {
  truck_state_ = state;
  seen_.truck_state_received = now;
  const bool at_rest = !state.engaged && !state.stopping;
  standby_seen_ = standby_seen_ || at_rest;
  if (at_rest && latched_ && age(seen_.latched_at, now) > parameters_.recovery_time) latched_.reset();
}

bool Arbiter::selectDriver(Source driver) {
  if (driver != Source::kLidarDriver && driver != Source::kPreviewDriver) return false;
  const bool there = std::any_of(all_sources_.begin(), all_sources_.end(), [&](const SourceRule& rule) {
    return rule.source == driver && rule.steers;
  });
  if (!there) return false;
  parameters_.sources.clear();
  for (const SourceRule& rule : all_sources_) {
    const bool left_out = rule.source == Source::kLidarDriver && driver == Source::kPreviewDriver;
    if (!left_out) parameters_.sources.push_back(rule);
  }
  seen_.disagree_since.reset();
  return true;
}

void Arbiter::requestStop(Stamp now) {
  latched_ = Reason::kOperatorStop;
  seen_.latched_at = now;
}

bool Arbiter::reset(Stamp now) {
  const bool moves = !history_.empty() && std::abs(history_.latest().speed) > kStanding;
  if (moves || assess(now).stop != Reason::kNone) return false;
  latched_.reset();
  return true;
}

void Arbiter::clockJumped() {
  if (engaged() && !latched_) latched_ = Reason::kClockJump;
  seen_ = {};
  history_.clear();
  forgetPlaces();
  yaw_.reset();
  free_ways_.clear();
}

// ---- findings

bool Arbiter::engaged() const { return !parameters_.needs_truck_state || truck_state_.engaged; }

Arbiter::Health Arbiter::health(const SourceRule& rule, Stamp now) const {
  const Slot& slot = seen_.slots[static_cast<std::size_t>(rule.source)];
  if (!slot.received) return Health::kNever;
  const double stamp_age = toSeconds(now - slot.proposal.stamp);
  if (age(slot.received, now) > rule.max_age || stamp_age > parameters_.max_stamp_age) {
    return Health::kStale;
  }
  if (!isPossible(slot.proposal) || stamp_age < -parameters_.max_future) return Health::kInvalid;
  if (!slot.proposal.valid) return Health::kUnable;
  // Written so that a confidence that is no number is none.
  return slot.proposal.confidence >= rule.min_confidence ? Health::kHealthy : Health::kUnsure;
}

const SourceRule* Arbiter::bestSource(Stamp now) const {
  const SourceRule* best = nullptr;
  for (const SourceRule& rule : parameters_.sources) {
    if (!rule.steers || (best && best->priority > rule.priority)) continue;
    if (health(rule, now) == Health::kHealthy) best = &rule;
  }
  return best;
}

const drivers::Proposal* Arbiter::healthyProposal(Source source, Stamp now) const {
  for (const SourceRule& rule : parameters_.sources) {
    if (rule.source != source || health(rule, now) != Health::kHealthy) continue;
    return &seen_.slots[static_cast<std::size_t>(source)].proposal;
  }
  return nullptr;
}

// The network against the analytic driver: while both have an answer, they must be much the same.
void Arbiter::compareDrivers(Stamp now) {
  const drivers::Proposal* lidar = healthyProposal(Source::kLidarDriver, now);
  const drivers::Proposal* preview = healthyProposal(Source::kPreviewDriver, now);
  const bool disagree =
      lidar && preview &&
      std::abs(lidar->articulation_angle - preview->articulation_angle) > parameters_.disagreement_angle;
  if (!disagree) {
    seen_.disagree_since.reset();
  } else if (!seen_.disagree_since) {
    seen_.disagree_since = now;
  }
}

// No scan was accepted lately: do any come at all? Bad ones may come more seldom than good ones.
Reason Arbiter::whyNoScan(Stamp now) const {
  const bool accepted = age(seen_.scan_received, now) <= parameters_.scan_degraded_age;
  const bool come = age(seen_.rejection_received, now) <= 2.0 * parameters_.scan_degraded_age;
  if (accepted || !come) return Reason::kScanStale;
  return rejection_.frozen ? Reason::kScanFrozen : Reason::kScanRejected;
}

void Arbiter::assessScan(Stamp now, Findings& findings) const {
  if (!seen_.scan_received) return findings.stopFor(Reason::kStartUp);
  const double received = age(seen_.scan_received, now);
  const double oldest = std::max(received, toSeconds(now - points_stamp_));
  if (oldest > parameters_.scan_stop_age) findings.stopFor(whyNoScan(now));
  if (received > parameters_.scan_degraded_age) findings.slowFor(whyNoScan(now));
  if (!parameters_.wall_checks) return;
  if (!seen_.corridor_stamp) return findings.stopFor(Reason::kStartUp);
  if (toSeconds(now - *seen_.corridor_stamp) > parameters_.scan_stop_age) {
    findings.stopFor(whyNoScan(now));
  }
}

void Arbiter::assessTunnel(Stamp now, Findings& findings) const {
  if (!seen_.tunnel_received) return findings.stopFor(Reason::kStartUp);
  const double without = age(seen_.tunnel_valid_received, now);
  if (without > parameters_.tunnel_grace) findings.stopFor(Reason::kTunnelInvalid);
  if (without > parameters_.scan_degraded_age) findings.slowFor(Reason::kTunnelInvalid);
}

bool Arbiter::motionHealthy(Stamp now) const {
  return motion_usable_ && !history_.empty() &&
         age(seen_.motion_received, now) <= parameters_.motion_stop_age &&
         toSeconds(now - history_.latest().stamp) <= parameters_.max_stamp_age;
}

void Arbiter::assessMotion(Stamp now, Findings& findings) const {
  if (!seen_.motion_received && motion_usable_) return findings.stopFor(Reason::kStartUp);
  if (!motionHealthy(now)) findings.stopFor(Reason::kMotionStale);
  if (steering_monitor_.failed()) findings.stopFor(Reason::kTrackingError);
}

void Arbiter::assessTruck(Stamp now, Findings& findings) const {
  if (!parameters_.needs_truck_state) return;
  if (!seen_.truck_state_received) return findings.stopFor(Reason::kStartUp);
  // An arbiter that comes up behind a truck already under way has not seen it engage.
  if (truck_state_.engaged && !standby_seen_) findings.stopFor(Reason::kStartUp);
  if (truck_state_.stopping) {
    // A truck that stops for no reason, or for one we do not know, stops all the same.
    const bool known = gravity(truck_state_.reason) > 0;
    findings.stopFor(known ? truck_state_.reason : Reason::kTruckFault);
  }
  if (age(seen_.truck_state_received, now) > parameters_.truck_state_stop_age) {
    findings.stopFor(Reason::kFeedbackStale);
  }
}

// A scan is late, or came late and has still to become this source's proposal.
bool Arbiter::waitsForScan(const SourceRule& rule, Stamp now) const {
  if (age(seen_.scan_received, now) > parameters_.scan_degraded_age) return true;
  const Stamp measured = seen_.slots[static_cast<std::size_t>(rule.source)].proposal.stamp;
  return age(seen_.gap_ended, now) <= rule.max_age &&
         toSeconds(now - measured) <= parameters_.scan_stop_age;
}

// Without a healthy source the truck stops, unless what the sources lack is about to be judged by
// itself: a late scan or an invalid tunnel, each with its own grace.
void Arbiter::assessSources(Stamp now, Findings& findings) const {
  // By Health; of a healthy source there is none.
  constexpr std::array<Reason, 5> kCauses = {Reason::kStartUp, Reason::kSourceStale,
                                             Reason::kProposalInvalid, Reason::kNoSource,
                                             Reason::kLowConfidence};
  if (bestSource(now)) return;
  const bool tunnel_lost = seen_.tunnel_received && !tunnel_state_.valid;
  Findings causes;
  bool excused = false;
  for (const SourceRule& rule : parameters_.sources) {
    if (!rule.steers) continue;
    const Health state = health(rule, now);
    causes.stopFor(kCauses.at(static_cast<std::size_t>(state)));
    if (state == Health::kStale && waitsForScan(rule, now)) excused = true;
    if (state == Health::kUnable && tunnel_lost) excused = true;
  }
  if (!excused) findings.stopFor(causes.stop);
}

// A source that would steer, were it sure, sees something that others may not see as well: slowly. One
// that must be sure of its proposals and makes none is not sure either.
void Arbiter::assessConfidence(Stamp now, Findings& findings) const {
  const SourceRule* best = bestSource(now);
  for (const SourceRule& rule : parameters_.sources) {
    const bool before_best = rule.steers && (!best || rule.priority > best->priority);
    const Health state = health(rule, now);
    const bool unsure =
        state == Health::kUnsure || (state == Health::kUnable && rule.min_confidence > 0.0);
    if (before_best && unsure) findings.slowFor(Reason::kLowConfidence);
  }
  if (seen_.disagree_since && age(seen_.disagree_since, now) >= parameters_.disagreement_time) {
    findings.slowFor(Reason::kDriversDisagree);
  }
}

Arbiter::Findings Arbiter::assess(Stamp now) const {
  Findings findings;
  assessScan(now, findings);
  assessTunnel(now, findings);
  assessMotion(now, findings);
  assessTruck(now, findings);
  assessSources(now, findings);
  assessConfidence(now, findings);
  if (seen_.obstacle_scans >= parameters_.obstacle_scans) findings.stopFor(Reason::kObstacle);
  if (seen_.obstructed_scans >= parameters_.wall_scans) findings.stopFor(obstruction_);
  if (seen_.hits >= parameters_.limit_hits) findings.slowFor(Reason::kLimitsHit);
  return findings;
}

// ---- choices

Arbiter::Steering Arbiter::chooseSteering(Stamp now) const {
  if (const SourceRule* best = bestSource(now)) {
    const drivers::Proposal& proposal = seen_.slots[static_cast<std::size_t>(best->source)].proposal;
    return {best->source, proposal.articulation_angle, proposal.stamp};
  }
  if (const std::optional<Steering> reckoned = deadReckoning(now)) return *reckoned;
  const Stamp stamp = history_.empty() ? Stamp{} : history_.latest().stamp;
  return {Source::kHold, limiter_.articulation(), stamp};
}

std::optional<geometry::Pose> Arbiter::placeInCenterline(Stamp now) const {
  if (!centerline_pose_) return std::nullopt;
  const std::optional<geometry::Pose> here = history_.poseAt(now);
  if (!here) return std::nullopt;
  return centerline_pose_->relative(*here);
}

// Along the last measured centerline; the law looks ahead by the steering's own delay.
std::optional<Arbiter::Steering> Arbiter::deadReckoning(Stamp now) const {
  if (!motionHealthy(now) || age(seen_.tunnel_valid_received, now) > parameters_.dead_reckoning_age) {
    return std::nullopt;
  }
  const std::optional<geometry::Pose> here = placeInCenterline(now);
  if (!here) return std::nullopt;
  const drivers::Motion& motion = history_.latest();
  const geometry::Pose ahead = drivers::advanced(*here, motion.speed, motion.yaw_rate,
                                                 truck_.steering.dead_time + truck_.steering.lag);
  const geometry::PathProjection place = centerline_.project(ahead.position());
  const double articulation = drivers::followPath(
      profile_, parameters_.envelope.follower, place.s, place.lateral_offset,
      geometry::wrapAngle(ahead.heading - place.heading), parameters_.limiter.max_articulation);
  return Steering{Source::kDeadReckoning, articulation, motion.stamp};
}

Arbiter::Speed Arbiter::chooseSpeed(Stamp now) {
  Speed lowest{parameters_.governor.max_speed, Source::kNone, SpeedLimit::kNone};
  const auto take = [&lowest](double speed, SpeedLimit by) {
    if (speed < lowest.value) lowest = {speed, lowest.source, by};
  };
  if (const std::optional<geometry::Pose> here = placeInCenterline(now)) {
    const double s = centerline_.project(here->position()).s;
    const SpeedGovernor::Limit limit = governor_.alongPath(profile_, s);
    take(limit.speed, limit.by);
    if (!parameters_.wall_checks) {
      take(governor_.stoppingWithin(centerline_.points().back().s - s), SpeedLimit::kSight);
    }
  }
  if (seen_.corridor_stamp) {
    const FreeWay free = freeWay();
    const bool blocked = free.until != Envelope::End::kSight;
    take(governor_.stoppingWithin(free.distance), blocked ? SpeedLimit::kObstacle : SpeedLimit::kSight);
  }
  decision_.speed_limit = lowest.value;
  for (const SourceRule& rule : parameters_.sources) {
    if (!rule.gives_speed || health(rule, now) != Health::kHealthy) continue;
    const double speed = seen_.slots[static_cast<std::size_t>(rule.source)].proposal.speed;
    if (speed < lowest.value) lowest = {speed, rule.source, SpeedLimit::kDriver};
  }
  return lowest;
}

// ---- the corridor

// The longest that the last obstacle_scans scans told: a clump of dust in one of them shall not brake
// the truck.
Arbiter::FreeWay Arbiter::freeWay() const {
  const auto shorter = [](const FreeWay& a, const FreeWay& b) { return a.distance < b.distance; };
  FreeWay free = *std::max_element(free_ways_.begin(), free_ways_.end(), shorter);
  free.distance = std::max(0.0, free.distance);
  return free;
}

// Compares each scan once, when its points, walls and tunnel have all come; in between, the way driven
// eats up the free distance.
void Arbiter::updateCorridor(double commanded, Stamp now) {
  if (!parameters_.wall_checks || history_.empty()) return;
  const bool complete = seen_.scan_received && seen_.tunnel_received && walls_.stamp == points_stamp_ &&
                        tunnel_state_.stamp == points_stamp_;
  const bool fresh = !seen_.corridor_stamp || *seen_.corridor_stamp != points_stamp_;
  const drivers::Motion& motion = history_.latest();
  const std::optional<geometry::Pose> scan_pose = history_.poseAt(points_stamp_);
  const std::optional<geometry::Pose> here = history_.poseAt(now);
  for (FreeWay& free : free_ways_) free.distance -= std::abs(motion.speed) * age(seen_.last, now);
  if (!complete || !fresh || !scan_pose || !here) return;
  const geometry::Pose path_frame =
      centerline_pose_ ? scan_pose->relative(*centerline_pose_) : geometry::Pose{};
  envelope_.update({walls_, points_, centerline_, centerline_pose_ ? profile_ : no_profile_, path_frame,
                    scan_pose->relative(*here), *scan_pose, motion.articulation, commanded,
                    std::abs(motion.speed), yaw_.response(), slip_compliance_});
  seen_.corridor_stamp = points_stamp_;
  const Envelope::Result& result = envelope_.result();
  free_ways_.push_back({result.free_distance, result.free_until});
  if (free_ways_.size() > static_cast<std::size_t>(parameters_.obstacle_scans)) {
    free_ways_.erase(free_ways_.begin());
  }
  const double needed =
      envelope_.stoppingDistance(std::abs(motion.speed)) + parameters_.envelope.reserve;
  const bool obstructed = result.free_until != Envelope::End::kSight && result.free_distance < needed;
  const bool by_wall = result.free_until == Envelope::End::kWall;
  seen_.obstructed_scans = obstructed ? seen_.obstructed_scans + 1 : 0;
  seen_.obstacle_scans = obstructed && !by_wall ? seen_.obstacle_scans + 1 : 0;
  obstruction_ = by_wall ? Reason::kClearance : Reason::kObstacle;
}

void Arbiter::tellCorridor() {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const bool known = seen_.corridor_stamp.has_value();
  const Envelope::Result& result = envelope_.result();
  decision_.clearance_left = known ? result.clearance_left : unknown;
  decision_.clearance_right = known ? result.clearance_right : unknown;
  decision_.free_distance = known ? freeWay().distance : unknown;
  decision_.stopping_distance =
      history_.empty() ? unknown : envelope_.stoppingDistance(std::abs(history_.latest().speed));
  decision_.corridor_left = result.corridor_left;
  decision_.corridor_right = result.corridor_right;
}

// ---- the decision

void Arbiter::watchClock(Stamp now) {
  if (!seen_.last) return;
  const double step = toSeconds(now - *seen_.last);
  if (step < 0.0 || step > parameters_.clock_jump) clockJumped();
}

// A stop stays until the operator's reset. Before the first inputs there is nothing to latch, unless the
// truck is already under way (the arbiter was started anew).
void Arbiter::latch(Findings& findings, Stamp now) {
  const bool counts = findings.stop != Reason::kStartUp || parameters_.needs_truck_state;
  if (engaged() && findings.stop != Reason::kNone && counts && !latched_) {
    latched_ = findings.stop;
    seen_.latched_at = now;
  }
  if (latched_) findings.stop = *latched_;
}

// A truck that stands before an obstacle or at the end of sight drives on when the way has been free for
// a while: somebody who walks to and fro before it must not tug it along step by step.
Arbiter::Speed Arbiter::waitForFreeWay(const Speed& speed, Stamp now) {
  const bool blocked = speed.by == SpeedLimit::kObstacle || speed.by == SpeedLimit::kSight;
  const bool stands = !history_.empty() && std::abs(history_.latest().speed) < kStanding;
  if (blocked && stands && speed.value < kStanding) {
    waits_for_ = speed.by;
    seen_.wait_until = now + fromSeconds(parameters_.recovery_time);
  }
  if (!seen_.wait_until || *seen_.wait_until <= now) return speed;
  return {0.0, Source::kNone, waits_for_};
}

bool Arbiter::slowNow(Reason found, Stamp now) {
  if (found != Reason::kNone) {
    slow_reason_ = found;
    seen_.slow_until = now + fromSeconds(parameters_.recovery_time);
  }
  return seen_.slow_until && *seen_.slow_until > now;
}

void Arbiter::watchLimits(const CommandLimiter::Flags& fired, Stamp now) {
  if (age(seen_.last_hit, now) > parameters_.recovery_time) seen_.hits = 0;
  if (!(fired.angle || fired.lateral_acceleration) || !engaged()) return;
  ++seen_.hits;
  seen_.last_hit = now;
}

const Decision& Arbiter::decide(Stamp now) {
  watchClock(now);
  const Steering steering = chooseSteering(now);
  updateCorridor(steering.articulation, now);
  compareDrivers(now);
  Findings findings = assess(now);
  latch(findings, now);
  Speed speed = waitForFreeWay(chooseSpeed(now), now);
  const bool stop = findings.stop != Reason::kNone;
  decision_.degraded = slowNow(findings.slow, now) && !stop;
  if (decision_.degraded && parameters_.degraded_speed < speed.value) {
    speed = {parameters_.degraded_speed, Source::kNone, SpeedLimit::kDegraded};
  }
  if (stop) speed = {0.0, Source::kNone, SpeedLimit::kStop};
  letOut(steering, speed, stop, now);
  decision_.command.reason = reasonOf(findings.stop, speed);
  tellCorridor();
  seen_.last = now;
  return decision_;
}

Reason Arbiter::reasonOf(Reason stop, const Speed& speed) const {
  if (stop != Reason::kNone) return stop;
  if (!engaged()) return Reason::kNotEngaged;
  if (decision_.degraded) return slow_reason_;
  if (speed.value > kStanding) return Reason::kNone;
  if (speed.by == SpeedLimit::kObstacle) return Reason::kObstacle;
  return speed.by == SpeedLimit::kSight ? Reason::kTunnelInvalid : Reason::kNone;
}

// The only place where a command is made. While others steer, it starts from where the truck stands.
void Arbiter::letOut(const Steering& steering, const Speed& speed, bool stop, Stamp now) {
  const bool obeyed = engaged() || truck_state_.stopping;
  const double measured_speed = history_.empty() ? 0.0 : history_.latest().speed;
  const double measured = history_.empty() ? limiter_.articulation() : history_.latest().articulation;
  if (!obeyed || (!started_ && !history_.empty())) {
    limiter_.start(measured, measured_speed);
    steering_monitor_.start(measured, now);
    started_ = !history_.empty();
  }
  const double elapsed = seen_.last ? toSeconds(now - *seen_.last) : 0.0;
  const CommandLimiter::Result result =
      limiter_.limit({steering.articulation, speed.value, measured_speed, stop}, elapsed);
  if (obeyed && motionHealthy(now)) {
    steering_monitor_.update(result.articulation, measured, measured_speed, now);
  }
  watchLimits(result.fired, now);
  Command& command = decision_.command;
  command.stamp = steering.stamp;
  ++command.sequence;
  command.articulation_angle = result.articulation;
  command.speed = result.speed;
  command.acceleration = result.acceleration;
  command.stop = stop;
  command.mode = !obeyed                                     ? Mode::kStandby
                 : steering.source == Source::kTeleoperation ? Mode::kTeleoperation
                                                             : Mode::kAutonomous;
  command.source = steering.source;
  decision_.speed_source = speed.source;
  decision_.limited_by = speed.by;
  decision_.limits = result.fired;
}

}  // namespace tunnel_pilot::supervision
