#include "tunnel_pilot/drivers/preview_driver.h"

#include <algorithm>

namespace tunnel_pilot::drivers {

PreviewDriverParameters loadPreviewDriver(config::Node node) {
  PreviewDriverParameters p{};
  p.speed = node.number("speed", "m/s", 0.1, 15.0);
  p.planning_speed = node.number("planning_speed", "m/s", 0.1, 3.0);
  p.preview_time = node.number("preview_time", "s", 0.1, 5.0);
  p.step = node.number("step", "s", 0.02, 0.5);
  config::Node weights = node.child("weights");
  p.weights.offset = weights.number("offset", "1/m^2", 1e-3, 1e3);
  p.weights.heading = weights.number("heading", "1/rad^2", 0.0, 1e4);
  p.weights.slope = weights.number("slope", "m^2/rad^2", 1e-2, 1e5);
  p.weights.slope_speed = weights.number("slope_speed", "m/s", 0.1, 10.0);
  p.weights.terminal = weights.number("terminal", "1", 1.0, 1e3);
  p.weights.rate_share = weights.number("rate_share", "1", 0.3, 1.0);
  weights.finish();
  p.truck = loadPathPredictor(node);
  node.finish();
  return p;
}

PreviewDriver::PreviewDriver(const PreviewDriverParameters& parameters,
                             const vehicle::TruckGeometry& geometry)
    : parameters_(parameters),
      predictor_(parameters.truck, geometry),
      planner_(predictor_.truck(), parameters.weights, parameters.step) {}

void PreviewDriver::reset() {
  predictor_.reset();
  planner_.reset();
}

Proposal PreviewDriver::propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) {
  Proposal proposal;
  proposal.stamp = tunnel.state.stamp;
  const std::optional<PathState> start = predictor_.predict(tunnel, motion, now);
  if (!start) return proposal;

  const double elapsed = predictor_.elapsed(now);
  const double speed = std::max(motion.speed, parameters_.planning_speed);
  const double rate = planner_.plan(*start, tunnel.centerline, speed, predictor_.learned(), elapsed);

  proposal.valid = true;
  proposal.articulation_angle = predictor_.give(start->command + rate * elapsed, *start, now);
  proposal.speed = parameters_.speed;
  proposal.confidence = confidence(tunnel.state);
  const geometry::PathPoint ahead =
      tunnel.centerline.at(predictor_.footPoint() + speed * parameters_.preview_time);
  proposal.preview_point = geometry::Point(ahead.x, ahead.y);
  return proposal;
}

}  // namespace tunnel_pilot::drivers
