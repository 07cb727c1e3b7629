#include <algorithm>
#include <cmath>

#include "closed_loop.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr double kSensedBehind = 5.0;   // sensed path begins so far behind the truck [m]
constexpr double kSensedAhead = 40.0;   // full preview [m]
constexpr double kSensedSpacing = 0.5;  // [m]
constexpr double kNominalWidth = 9.0;   // a haul road's, told for completeness [m]
constexpr double kUnlimited = 100.0;    // the speed is fixed: the governor has no say

PilotParameters withFixedSpeed(PilotParameters parameters, double speed) {
  parameters.preview_driver.speed = speed;
  parameters.preview_driver.weights.sharp_speed = kUnlimited;
  parameters.arbiter.wall_checks = false;
  parameters.arbiter.governor.max_lateral_acceleration = kUnlimited;
  parameters.arbiter.governor.max_articulation_rate = kUnlimited;
  return parameters;
}

world::World openGround(const LaneChangeExperiment& change) {
  world::World world;
  world.name = "open ground";
  world.design_line = laneChangePath(change);
  world.width = kNominalWidth;
  return world;
}

// Sample of a path that goes on straight beyond its ends.
geometry::PathPoint prolongedAt(const geometry::Path& path, double s) {
  geometry::PathPoint point = path.at(s);
  const double beyond = s - point.s;
  if (beyond == 0.0) return point;
  point.s = s;
  point.x += beyond * std::cos(point.heading);
  point.y += beyond * std::sin(point.heading);
  point.curvature = 0.0;
  return point;
}

class LaneChange : public ClosedLoop {
 public:
  LaneChange(const LaneChangeExperiment& change, const Scenario& scenario, const Setup& setup,
             const EpisodePlan& plan, DriveObserver* observer)
      : ClosedLoop(scenario, setup, withFixedSpeed(setup.pilot, change.speed), openGround(change), plan),
        change_(change),
        noise_(plan.seed, Stream::kSensedPath),
        observer_(observer) {}

  EpisodeResult run() {
    EpisodeResult result;
    const geometry::Path& line = simulator_.world().design_line;
    result.ending = "not engaged";
    if (handOver({}, change_.speed)) {
      const double time_limit = 2.0 * line.length() / change_.speed;
      do {
        step();
        result.ending = simulator_.truth().station >= line.length() ? "way driven" : whyOver(time_limit);
      } while (result.ending.empty());
    }
    result.metrics = pathMetrics(track_);
    result.metrics["speed_mean"] = driveMetrics(track_, line).at("speed_mean");
    result.metrics["completed"] = result.ending == "way driven" ? 1.0 : 0.0;
    result.track = std::move(track_);
    result.line = line;
    return result;
  }

 private:
  void takeScan(const geometry::Scan& scan) override {
    logMeasurement(scan.stamp);
    pilot_.takeTunnel(sensed(simulator_.truthOfScan(), scan.stamp), simulator_.now());
    if (driving_ && observer_ != nullptr) observer_->afterScan(simulator_, pilot_);
  }

  // The path as a sensor tells it that sees the whole of it, wrong by one shift and one turn each time.
  perception::Tunnel sensed(const Truth& truth, Stamp stamp) {
    const double shift = change_.offset_sigma * noise_.normal();
    const double turn = change_.heading_sigma * noise_.normal();
    const geometry::Path& line = simulator_.world().design_line;
    const geometry::PathPoint foot = prolongedAt(line, truth.station);
    // Where the truck would have to be for the reading to be right.
    const double offset = truth.lateral_offset + shift;
    const geometry::Pose seen =
        geometry::Pose{foot.x, foot.y, foot.heading}.compose({0.0, offset, truth.heading_error + turn});
    perception::Tunnel tunnel;
    tunnel.state.stamp = stamp;
    tunnel.state.valid = true;
    tunnel.state.reason = perception::TunnelReason::kNone;
    tunnel.state.lateral_offset = offset;
    tunnel.state.heading_error = geometry::wrapAngle(truth.heading_error + turn);
    tunnel.state.curvature = foot.curvature;
    tunnel.state.width = kNominalWidth;
    tunnel.state.covariance[0] = change_.offset_sigma * change_.offset_sigma;
    tunnel.state.covariance[5] = change_.heading_sigma * change_.heading_sigma;
    tunnel.centerline = seenFrom(seen, truth.station);
    return tunnel;
  }

  geometry::Path seenFrom(const geometry::Pose& pose, double station) const {
    const geometry::Path& line = simulator_.world().design_line;
    std::vector<geometry::PathPoint> points;
    for (double s = -kSensedBehind; s <= kSensedAhead; s += kSensedSpacing) {
      geometry::PathPoint point = prolongedAt(line, station + s);
      const geometry::Point local = pose.inverseTransform({point.x, point.y});
      points.push_back({s + kSensedBehind, local.x(), local.y(),
                        geometry::wrapAngle(point.heading - pose.heading), point.curvature});
    }
    return geometry::Path(std::move(points));
  }

  LaneChangeExperiment change_;
  Random noise_;
  DriveObserver* observer_;
};

}  // namespace

EpisodeResult runLaneChange(const LaneChangeExperiment& change, const Scenario& scenario,
                            const Setup& setup, const EpisodePlan& plan, DriveObserver* observer) {
  return LaneChange(change, scenario, setup, plan, observer).run();
}

}  // namespace tunnel_pilot::simulation
