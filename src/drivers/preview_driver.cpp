#include "tunnel_pilot/drivers/preview_driver.h"

#include <algorithm>

namespace tunnel_pilot::drivers {

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
  planner_.setMaxRate(predictor_.truck().max_rate);
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
