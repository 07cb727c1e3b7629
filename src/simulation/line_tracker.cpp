#include "tunnel_pilot/simulation/line_tracker.h"

namespace tunnel_pilot::simulation {

constexpr double kWindow = 3.0;  // further than a truck drives between two updates [m]

geometry::PathProjection LineTracker::update(const geometry::Point& point) {
  geometry::PathProjection foot =
      last_ ? line_->project(point, last_->s, kWindow) : line_->project(point);
  if (!last_) turns_ = 0.0;
  if (last_ && line_->closed()) {
    const double half = 0.5 * line_->length();
    if (foot.s - last_->s < -half) turns_ += 1.0;
    if (foot.s - last_->s > half) turns_ -= 1.0;
  }
  last_ = foot;
  foot.s += turns_ * line_->length();
  return foot;
}

}  // namespace tunnel_pilot::simulation
