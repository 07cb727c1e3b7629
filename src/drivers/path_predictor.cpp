#include "tunnel_pilot/drivers/path_predictor.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_cursor.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr double kLongestPause = 0.1;     // [s] a command moves no further than in this time
constexpr double kPredictionStep = 0.03;  // [s]
constexpr double kSteady = 0.01;          // [rad] nearer to its command, the articulation stands
constexpr double kOffsetJump = 0.5;       // [m] beyond, the filter starts anew
constexpr double kHeadingJump = 0.15;     // [rad]
// How fast a reversing command crosses the valve's dead band, in its own movements.
constexpr double kDeadBandGain = 2.0;

double gain(double elapsed, double memory) { return 1.0 - std::exp(-elapsed / std::max(memory, 1e-6)); }

TruckResponse response(const PathPredictorParameters& p, const vehicle::TruckGeometry& geometry) {
  return {geometry, p.lag, p.max_rate, std::min(p.max_articulation, geometry.max_articulation),
          p.slip_compliance};
}

bool isFinite(const perception::TunnelState& state) {
  return std::isfinite(state.lateral_offset) && std::isfinite(state.heading_error) &&
         std::isfinite(state.curvature);
}

}  // namespace

PathPredictorParameters loadPathPredictor(config::Node& node) {
  PathPredictorParameters p{};
  p.max_tunnel_age = node.number("max_tunnel_age", "s", 0.05, 1.0);
  config::Node steering = node.child("steering");
  p.dead_time = steering.number("dead_time", "s", 0.0, 1.0);
  p.transport_delay = steering.number("transport_delay", "s", 0.0, 0.3);
  p.lag = steering.number("lag", "s", 0.02, 2.0);
  p.dead_band = steering.number("dead_band", "rad", 0.0, 0.05);
  p.lead = steering.number("lead", "rad", 0.01, 1.0);
  p.max_rate = steering.number("max_rate", "rad/s", 0.01, 2.0);
  p.max_articulation = steering.number("max_articulation", "rad", 0.1, 1.2);
  steering.finish();
  p.slip_compliance = node.number("slip_compliance", "rad s^2/m", 0.0, 0.1);
  config::Node filter = node.child("filter");
  p.offset_time = filter.number("offset_time", "s", 0.0, 2.0);
  p.heading_time = filter.number("heading_time", "s", 0.0, 2.0);
  p.bias_time = filter.number("bias_time", "s", 0.1, 100.0);
  p.max_bias = filter.number("max_bias", "rad", 0.0, 0.1);
  filter.finish();
  config::Node yaw = node.child("yaw_response");
  p.yaw.gain = yaw.number("gain", "1", 0.5, 1.5);
  p.yaw.gain_deviation = yaw.number("gain_deviation", "1", 0.0, 0.5);
  p.yaw.disturbance_deviation = yaw.number("disturbance_deviation", "1/m", 0.0, 0.05);
  p.yaw.memory = yaw.number("memory", "s", 1.0, 1000.0);
  p.yaw.noise = yaw.number("noise", "rad/s", 1e-3, 1.0);
  p.yaw.rate_noise = yaw.number("rate_noise", "1", 0.0, 2.0);
  p.yaw.least_speed = yaw.number("least_speed", "m/s", 0.1, 5.0);
  yaw.finish();
  return p;
}

double confidence(const perception::TunnelState& state) {
  const double doubt = state.covariance[0] / 0.01 + state.covariance[5] / 0.0025;
  return doubt >= 0.0 ? 1.0 / (1.0 + doubt) : 0.0;
}

PathPredictor::PathPredictor(const PathPredictorParameters& parameters,
                             const vehicle::TruckGeometry& geometry)
    : parameters_(parameters), truck_(response(parameters, geometry)), yaw_(parameters.yaw, geometry) {}

void PathPredictor::reset() {
  history_.clear();
  last_time_.reset();
  last_motion_.reset();
  last_scan_pose_.reset();
  yaw_.reset();
  bias_ = 0.0;
  play_ = 0.0;
}

bool PathPredictor::usable(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) const {
  const Stamp age = now - tunnel.state.stamp;
  return tunnel.state.valid && !tunnel.centerline.empty() && isFinite(tunnel.state) &&
         drivers::isFinite(motion) && age >= -MotionHistory::kReach &&
         toSeconds(age) <= parameters_.max_tunnel_age;
}

std::optional<PathState> PathPredictor::predict(const perception::Tunnel& tunnel, const Motion& motion,
                                                Stamp now) {
  history_.add(motion);
  if (!usable(tunnel, motion, now)) return std::nullopt;
  const std::optional<geometry::Pose> scan_pose = history_.poseAt(tunnel.state.stamp);
  if (!scan_pose) return std::nullopt;
  const Errors errors = filterErrors(tunnel, *scan_pose);
  learnFrom(motion);
  return overDeadTime(tunnel, *scan_pose, errors, *last_motion_, now);
}

double PathPredictor::elapsed(Stamp now) const {
  return last_time_ ? std::clamp(toSeconds(now - *last_time_), 0.0, kLongestPause) : 0.0;
}

PathPredictor::Errors PathPredictor::filterErrors(const perception::Tunnel& tunnel,
                                                  const geometry::Pose& scan_pose) {
  const perception::TunnelState& measured = tunnel.state;
  Errors errors{tunnel.centerline.project({0.0, 0.0}).s, measured.lateral_offset,
                measured.heading_error};
  if (last_scan_pose_ && measured.stamp >= last_scan_) {
    const double elapsed = toSeconds(measured.stamp - last_scan_);
    const Errors expected =
        carried(last_errors_, last_scan_pose_->relative(scan_pose), measured.curvature, elapsed,
                last_motion_ ? last_motion_->articulation : 0.0);
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

PathPredictor::Errors PathPredictor::carried(const Errors& from, const geometry::Pose& step,
                                             double curvature, double elapsed,
                                             double articulation) const {
  const double along = std::cos(from.heading) * step.x - std::sin(from.heading) * step.y;
  const double across = std::sin(from.heading) * step.x + std::cos(from.heading) * step.y;
  const double speed = elapsed > 0.0 ? along / elapsed : 0.0;
  const double sideways =
      elapsed > 0.0 ? -parameters_.slip_compliance * speed * step.heading / elapsed : 0.0;
  const double slip = sideways + (yaw_.response().gain - 1.0) * std::tan(0.5 * articulation);
  const double on_path = along / std::max(0.2, 1.0 - curvature * from.offset);
  return {from.s + on_path, from.offset + across + along * slip - 0.5 * curvature * on_path * on_path,
          from.heading + step.heading - curvature * on_path};
}

void PathPredictor::learnFrom(const Motion& motion) {
  if (!last_motion_) dropCommands(motion.articulation);
  const double elapsed = last_motion_ ? toSeconds(motion.stamp - last_motion_->stamp) : 0.0;
  if (last_motion_ && elapsed <= 0.0) return;
  if (elapsed > kLongestPause) dropCommands(motion.articulation);
  last_motion_ = motion;

  const double moving = commandAt(motion.stamp - delay()) - commanded_articulation_;
  commanded_articulation_ += gain(elapsed, parameters_.lag) * moving;
  if (std::abs(moving) < kSteady) {
    const double deviation = motion.articulation - commanded_articulation_;
    bias_ += gain(elapsed, parameters_.bias_time) * (deviation - bias_);
    bias_ = std::clamp(bias_, -parameters_.max_bias, parameters_.max_bias);
  }
  last_motion_->articulation -= bias_;
  yaw_.update(*last_motion_, elapsed);
}

PathState PathPredictor::overDeadTime(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose,
                                      const Errors& errors, const Motion& motion, Stamp now) const {
  const Errors driven = carried(errors, scan_pose.relative(motion.pose), tunnel.state.curvature,
                                toSeconds(motion.stamp - tunnel.state.stamp), motion.articulation);
  PathState state{driven.s, driven.offset, driven.heading, motion.articulation, 0.0};
  PathCursor cursor(tunnel.centerline, state.s);
  double heading = cursor.headingAt(state.s);
  const double span = std::clamp(toSeconds(now - motion.stamp), 0.0, 0.3) + toSeconds(delay());
  const int steps = std::max(1, static_cast<int>(std::ceil(span / kPredictionStep)));
  const double step = span / steps;
  const double share = lagShare(step, truck_.lag);
  for (int i = 0; i < steps; ++i) {
    state.command = commandAt(motion.stamp + fromSeconds((i + 0.5) * step) - delay());
    const double ahead = std::max(1e-3, motion.speed * step);
    const double curvature = (cursor.headingAt(state.s + ahead) - heading) / ahead;
    state = advancedOnPath(truck_, state, std::cos(state.heading_error), 0.0, motion.speed, curvature,
                           yaw_.response(), step, share);
    heading = cursor.headingAt(state.s);
  }
  state.command = given_[newest_].command;
  return state;
}

Stamp PathPredictor::delay() const {
  return fromSeconds(parameters_.dead_time + parameters_.transport_delay);
}

double PathPredictor::commandAt(Stamp time) const {
  for (std::size_t age = 0; age < given_.size(); ++age) {
    const Given& given = given_[(newest_ + given_.size() - age) % given_.size()];
    if (given.time <= time) return given.command;
  }
  return given_[(newest_ + 1) % given_.size()].command;  // the oldest
}

void PathPredictor::dropCommands(double articulation) {
  given_.fill({Stamp::min(), articulation});
  commanded_articulation_ = articulation;
  play_ = 0.0;
}

double PathPredictor::give(double command, const PathState& start, Stamp now) {
  // What leads the articulation by more than the lag explains would only have to be taken back.
  command =
      std::clamp(command, start.articulation - parameters_.lead, start.articulation + parameters_.lead);
  command = std::clamp(command, -parameters_.max_articulation, parameters_.max_articulation);
  const double half_band = 0.5 * parameters_.dead_band;
  play_ = std::clamp(play_ + kDeadBandGain * (command - given_[newest_].command), -half_band, half_band);
  newest_ = (newest_ + 1) % given_.size();
  given_[newest_] = {now, command};
  last_time_ = now;
  return std::clamp(command + play_, -parameters_.max_articulation, parameters_.max_articulation);
}

}  // namespace tunnel_pilot::drivers
