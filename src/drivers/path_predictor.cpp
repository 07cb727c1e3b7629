#include "tunnel_pilot/drivers/path_predictor.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_cursor.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr double kPredictionStep = 0.03;  // [s]
constexpr double kLeastSpan = 1e-6;       // [s] the model divides by its steps
constexpr double kOffsetJump = 0.5;       // [m] beyond, the filter starts anew
constexpr double kHeadingJump = 0.15;     // [rad]

double gain(double elapsed, double memory) { return 1.0 - std::exp(-elapsed / std::max(memory, 1e-6)); }

TruckResponse response(const PathPredictorParameters& p, const vehicle::TruckGeometry& geometry) {
  const SteeringEstimatorParameters& steering = p.steering;
  return {geometry, steering.lag, steering.max_rate,
          std::min(steering.max_articulation, geometry.max_articulation), p.slip_compliance};
}

bool isFinite(const perception::TunnelState& state) {
  return std::isfinite(state.lateral_offset) && std::isfinite(state.heading_error) &&
         std::isfinite(state.curvature);
}

}  // namespace

PathPredictorParameters loadPathPredictor(config::Node& node) {
  PathPredictorParameters p{};
  p.max_tunnel_age = node.number("max_tunnel_age", "s", 0.05, 1.0);
  p.steering = loadSteeringEstimator(node);
  p.slip_compliance = node.number("slip_compliance", "rad s^2/m", 0.0, 0.1);
  config::Node filter = node.child("filter");
  p.offset_time = filter.number("offset_time", "s", 0.0, 2.0);
  p.heading_time = filter.number("heading_time", "s", 0.0, 2.0);
  filter.finish();
  return p;
}

double confidence(const perception::TunnelState& state) {
  const double doubt = state.covariance[0] / 0.01 + state.covariance[5] / 0.0025;
  return doubt >= 0.0 ? 1.0 / (1.0 + doubt) : 0.0;
}

PathPredictor::PathPredictor(const PathPredictorParameters& parameters,
                             const vehicle::TruckGeometry& geometry)
    : parameters_(parameters),
      truck_(response(parameters, geometry)),
      steering_(parameters.steering, geometry) {}

void PathPredictor::reset() {
  history_.clear();
  last_scan_pose_.reset();
  steering_.reset();
}

bool PathPredictor::usable(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) const {
  const Stamp age = now - tunnel.state.stamp;
  return tunnel.state.valid && !tunnel.centerline.empty() && isFinite(tunnel.state) &&
         drivers::isUsable(motion) && motion.stamp <= now + MotionHistory::kMaxAhead &&
         age >= -MotionHistory::kReach && toSeconds(age) <= parameters_.max_tunnel_age;
}

std::optional<PathState> PathPredictor::predict(const perception::Tunnel& tunnel, const Motion& motion,
                                                Stamp now) {
  history_.add(motion, now);
  if (!usable(tunnel, motion, now)) return std::nullopt;
  const std::optional<geometry::Pose> scan_pose = history_.poseAt(tunnel.state.stamp);
  if (!scan_pose) return std::nullopt;
  const Errors errors = filterErrors(tunnel, *scan_pose);
  steering_.observe(motion);
  truck_.max_rate = steering_.maxRate();
  return overDeadTime(tunnel, *scan_pose, errors, steering_.motion(), now);
}

PathPredictor::Errors PathPredictor::filterErrors(const perception::Tunnel& tunnel,
                                                  const geometry::Pose& scan_pose) {
  const perception::TunnelState& measured = tunnel.state;
  Errors errors{tunnel.centerline.project({0.0, 0.0}).s, measured.lateral_offset,
                measured.heading_error};
  if (last_scan_pose_ && measured.stamp >= last_scan_) {
    const double elapsed = toSeconds(measured.stamp - last_scan_);
    const Errors expected =
        carried(last_errors_, last_scan_pose_->relative(scan_pose), measured.curvature);
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
                                             double curvature) const {
  const double along = std::cos(from.heading) * step.x - std::sin(from.heading) * step.y;
  const double across = std::sin(from.heading) * step.x + std::cos(from.heading) * step.y;
  const double on_path = along / std::max(0.2, 1.0 - curvature * from.offset);
  return {from.s + on_path, from.offset + across - 0.5 * curvature * on_path * on_path,
          from.heading + step.heading - curvature * on_path};
}

PathState PathPredictor::overDeadTime(const perception::Tunnel& tunnel, const geometry::Pose& scan_pose,
                                      const Errors& errors, const Motion& motion, Stamp now) const {
  const Errors driven = carried(errors, scan_pose.relative(motion.pose), tunnel.state.curvature);
  PathState state{driven.s, driven.offset, driven.heading, motion.articulation, 0.0};
  PathCursor cursor(tunnel.centerline, state.s);
  double heading = cursor.headingAt(state.s);
  const double known =
      std::clamp(toSeconds(now - motion.stamp), 0.0, 0.3) + toSeconds(steering_.delay());
  const double span = std::max(known, kLeastSpan);
  const int steps = std::max(1, static_cast<int>(std::ceil(span / kPredictionStep)));
  const double step = span / steps;
  const double share = lagShare(step, truck_.lag);
  for (int i = 0; i < steps; ++i) {
    state.command = steering_.commandActing(motion.stamp + fromSeconds((i + 0.5) * step));
    const double ahead = std::max(1e-3, motion.speed * step);
    const double curvature = (cursor.headingAt(state.s + ahead) - heading) / ahead;
    state = advancedOnPath(truck_, state, std::cos(state.heading_error), 0.0, motion.speed, curvature,
                           steering_.learned(), step, share);
    heading = cursor.headingAt(state.s);
  }
  state.command = steering_.newestCommand();
  return state;
}

}  // namespace tunnel_pilot::drivers
