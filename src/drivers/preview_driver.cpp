#include "tunnel_pilot/drivers/preview_driver.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_cursor.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr double kLongestPause = 0.1;       // [s] a command moves no further than in this time
constexpr double kPredictionStep = 0.03;    // [s]
constexpr double kFollowingTime = 0.5;      // [s] memory of the watch on the truck's following
constexpr double kDisturbanceSpeed = 1.0;   // [m/s] slower, the gyro's drift outweighs the curvature
constexpr double kOffsetJump = 0.5;         // [m] beyond, the filter starts anew
constexpr double kHeadingJump = 0.15;       // [rad]
// How fast a reversing command crosses the valve's dead band, in its own movements.
constexpr double kDeadBandGain = 2.0;

double gain(double elapsed, double memory) { return 1.0 - std::exp(-elapsed / std::max(memory, 1e-6)); }

TruckResponse response(const PreviewDriverParameters& p, const vehicle::TruckGeometry& geometry) {
  return {geometry, p.lag, p.max_rate, std::min(p.max_articulation, geometry.max_articulation),
          p.slip_compliance};
}

bool isFinite(const perception::TunnelState& state) {
  return std::isfinite(state.lateral_offset) && std::isfinite(state.heading_error) &&
         std::isfinite(state.curvature);
}

// 1 for a perfectly known place in the tunnel, 1/2 for standard deviations of 0.1 m or 0.05 rad.
double confidence(const perception::TunnelState& state) {
  const double doubt = state.covariance[0] / 0.01 + state.covariance[5] / 0.0025;
  return doubt >= 0.0 ? 1.0 / (1.0 + doubt) : 0.0;
}

}  // namespace

PreviewDriverParameters loadPreviewDriver(config::Node node) {
  PreviewDriverParameters p{};
  p.speed = node.number("speed", "m/s", 0.1, 15.0);
  p.max_tunnel_age = node.number("max_tunnel_age", "s", 0.05, 1.0);
  p.planning_speed = node.number("planning_speed", "m/s", 0.1, 3.0);
  p.preview_time = node.number("preview_time", "s", 0.1, 5.0);
  p.step = node.number("step", "s", 0.02, 0.5);
  config::Node weights = node.child("weights");
  p.weights.offset = weights.number("offset", "1/m^2", 1e-3, 1e3);
  p.weights.heading = weights.number("heading", "1/rad^2", 0.0, 1e4);
  p.weights.rate = weights.number("rate", "s^2/rad^2", 1e-3, 1e4);
  p.weights.terminal = weights.number("terminal", "1", 1.0, 1e3);
  weights.finish();
  config::Node steering = node.child("steering");
  p.dead_time = steering.number("dead_time", "s", 0.0, 1.0);
  p.transport_delay = steering.number("transport_delay", "s", 0.0, 0.3);
  p.lag = steering.number("lag", "s", 0.02, 2.0);
  p.dead_band = steering.number("dead_band", "rad", 0.0, 0.05);
  p.max_rate = steering.number("max_rate", "rad/s", 0.01, 2.0);
  p.max_articulation = steering.number("max_articulation", "rad", 0.1, 1.2);
  steering.finish();
  p.slip_compliance = node.number("slip_compliance", "rad s^2/m", 0.0, 0.1);
  config::Node filter = node.child("filter");
  p.offset_time = filter.number("offset_time", "s", 0.0, 2.0);
  p.heading_time = filter.number("heading_time", "s", 0.0, 2.0);
  p.disturbance_time = filter.number("disturbance_time", "s", 0.1, 60.0);
  p.max_disturbance = filter.number("max_disturbance", "1/m", 0.0, 0.05);
  filter.finish();
  p.follow_tolerance = node.number("follow_tolerance", "rad", 0.02, 1.0);
  node.finish();
  return p;
}

PreviewDriver::PreviewDriver(const PreviewDriverParameters& parameters,
                             const vehicle::TruckGeometry& geometry)
    : parameters_(parameters),
      geometry_(geometry),
      planner_(response(parameters, geometry), parameters.weights, parameters.step) {}

void PreviewDriver::reset() {
  planner_.reset();
  history_.clear();
  last_time_.reset();
  last_motion_.reset();
  last_scan_pose_.reset();
  disturbance_ = 0.0;
  play_ = 0.0;
}

bool PreviewDriver::usable(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) const {
  const Stamp age = now - tunnel.state.stamp;
  return tunnel.state.valid && !tunnel.centerline.empty() && isFinite(tunnel.state) &&
         drivers::isFinite(motion) && age >= -MotionHistory::kReach &&
         toSeconds(age) <= parameters_.max_tunnel_age;
}

Proposal PreviewDriver::propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) {
  Proposal proposal;
  proposal.stamp = tunnel.state.stamp;
  history_.add(motion);
  if (!usable(tunnel, motion, now)) return proposal;
  const std::optional<geometry::Pose> scan_pose = history_.poseAt(tunnel.state.stamp);
  if (!scan_pose) return proposal;

  const Errors errors = filterErrors(tunnel, *scan_pose);
  learnFrom(motion);
  const double elapsed =
      last_time_ ? std::clamp(toSeconds(now - *last_time_), 0.0, kLongestPause) : 0.0;
  const PathState start = predict(tunnel, *scan_pose, errors, motion, now);
  const double speed = std::max(motion.speed, parameters_.planning_speed);
  const double rate = planner_.plan(start, tunnel.centerline, speed, disturbance_, elapsed);
  give(start.command + rate * elapsed, now);
  last_time_ = now;

  proposal.valid = true;
  proposal.articulation_angle = std::clamp(given_[newest_].command + play_, -parameters_.max_articulation,
                                           parameters_.max_articulation);
  proposal.speed = parameters_.speed;
  proposal.confidence = confidence(tunnel.state);
  const geometry::PathPoint ahead = tunnel.centerline.at(errors.s + speed * parameters_.preview_time);
  proposal.preview_point = geometry::Point(ahead.x, ahead.y);
  return proposal;
}

PreviewDriver::Errors PreviewDriver::filterErrors(const perception::Tunnel& tunnel,
                                                  const geometry::Pose& scan_pose) {
  const perception::TunnelState& measured = tunnel.state;
  Errors errors{tunnel.centerline.project({0.0, 0.0}).s, measured.lateral_offset,
                measured.heading_error};
  if (last_scan_pose_ && measured.stamp >= last_scan_) {
    const double elapsed = toSeconds(measured.stamp - last_scan_);
    const Errors expected = carried(last_errors_, last_scan_pose_->relative(scan_pose),
                                    measured.curvature, elapsed);
    const double offset_change = measured.lateral_offset - expected.offset;
    const double heading_change = geometry::wrapAngle(measured.heading_error - expected.heading);
    if (std::abs(offset_change) < kOffsetJump && std::abs(heading_change) < kHeadingJump) {
      errors.offset = expected.offset + gain(elapsed, parameters_.offset_time) * offset_change;
      errors.heading = expected.heading + gain(elapsed, parameters_.heading_time) * heading_change;
    }
  }
  last_scan_pose_ = scan_pose;
  last_scan_ = measured.stamp;
  last_errors_ = errors;
  return errors;
}

PreviewDriver::Errors PreviewDriver::carried(const Errors& from, const geometry::Pose& step,
                                             double curvature, double elapsed) const {
  const double along = std::cos(from.heading) * step.x - std::sin(from.heading) * step.y;
  const double across = std::sin(from.heading) * step.x + std::cos(from.heading) * step.y;
  const double speed = elapsed > 0.0 ? along / elapsed : 0.0;
  const double slip =
      elapsed > 0.0 ? -parameters_.slip_compliance * speed * step.heading / elapsed : 0.0;
  const double on_path = along / std::max(0.2, 1.0 - curvature * from.offset);
  return {from.s + on_path, from.offset + across + along * slip - 0.5 * curvature * on_path * on_path,
          from.heading + step.heading - curvature * on_path};
}

void PreviewDriver::learnFrom(const Motion& motion) {
  if (!last_motion_) dropCommands(motion.articulation);
  const double elapsed = last_motion_ ? toSeconds(motion.stamp - last_motion_->stamp) : 0.0;
  if (last_motion_ && elapsed <= 0.0) return;
  if (elapsed > kLongestPause) dropCommands(motion.articulation);
  last_motion_ = motion;

  const double wanted = commandAt(motion.stamp - delay()) - expected_articulation_;
  const double most = parameters_.max_rate * elapsed;
  expected_articulation_ += std::clamp(gain(elapsed, parameters_.lag) * wanted, -most, most);
  expected_articulation_ +=
      gain(elapsed, kFollowingTime) * (motion.articulation - expected_articulation_);
  if (std::abs(motion.articulation - expected_articulation_) > parameters_.follow_tolerance) {
    dropCommands(motion.articulation);
  }
  if (motion.speed < kDisturbanceSpeed) return;
  const double unexplained = motion.yaw_rate - vehicle::yawRate(geometry_, motion.speed, motion.articulation,
                                                                motion.articulation_rate);
  disturbance_ += gain(elapsed, parameters_.disturbance_time) * (unexplained / motion.speed - disturbance_);
  disturbance_ = std::clamp(disturbance_, -parameters_.max_disturbance, parameters_.max_disturbance);
}

PathState PreviewDriver::predict(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose,
                                 const Errors& errors, const Motion& motion, Stamp now) const {
  const Errors driven = carried(errors, scan_pose.relative(motion.pose), tunnel.state.curvature,
                                toSeconds(motion.stamp - tunnel.state.stamp));
  PathState state{driven.s, driven.offset, driven.heading, motion.articulation, 0.0};
  PathCursor cursor(tunnel.centerline, state.s);
  double heading = cursor.headingAt(state.s);
  const double span = std::clamp(toSeconds(now - motion.stamp), 0.0, 0.3) + toSeconds(delay());
  const int steps = std::max(1, static_cast<int>(std::ceil(span / kPredictionStep)));
  const double step = span / steps;
  for (int i = 0; i < steps; ++i) {
    state.command = commandAt(motion.stamp + fromSeconds((i + 0.5) * step) - delay());
    const double ahead = std::max(1e-3, motion.speed * step);
    const double curvature = (cursor.headingAt(state.s + ahead) - heading) / ahead;
    state = planner_.advance(state, 0.0, motion.speed, curvature, disturbance_, step);
    heading = cursor.headingAt(state.s);
  }
  state.command = given_[newest_].command;
  return state;
}

Stamp PreviewDriver::delay() const {
  return fromSeconds(parameters_.dead_time + parameters_.transport_delay);
}

double PreviewDriver::commandAt(Stamp time) const {
  for (std::size_t age = 0; age < given_.size(); ++age) {
    const Given& given = given_[(newest_ + given_.size() - age) % given_.size()];
    if (given.time <= time) return given.command;
  }
  return given_[(newest_ + 1) % given_.size()].command;  // the oldest
}

void PreviewDriver::dropCommands(double articulation) {
  given_.fill({Stamp::min(), articulation});
  expected_articulation_ = articulation;
  play_ = 0.0;
}

void PreviewDriver::give(double command, Stamp now) {
  command = std::clamp(command, -parameters_.max_articulation, parameters_.max_articulation);
  const double half_band = 0.5 * parameters_.dead_band;
  play_ = std::clamp(play_ + kDeadBandGain * (command - given_[newest_].command), -half_band, half_band);
  newest_ = (newest_ + 1) % given_.size();
  given_[newest_] = {now, command};
}

}  // namespace tunnel_pilot::drivers
