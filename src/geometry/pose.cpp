#include "tunnel_pilot/geometry/pose.h"

#include <cmath>

namespace tunnel_pilot::geometry {

double wrapAngle(double angle) {
  const double wrapped = std::remainder(angle, 2.0 * M_PI);
  return wrapped <= -M_PI ? wrapped + 2.0 * M_PI : wrapped;
}

Point Pose::transform(const Point& local) const {
  const double c = std::cos(heading);
  const double s = std::sin(heading);
  return {x + c * local.x() - s * local.y(), y + s * local.x() + c * local.y()};
}

Point Pose::inverseTransform(const Point& parent) const {
  const double c = std::cos(heading);
  const double s = std::sin(heading);
  const double dx = parent.x() - x;
  const double dy = parent.y() - y;
  return {c * dx + s * dy, -s * dx + c * dy};
}

Pose Pose::compose(const Pose& next) const {
  const Point p = transform(next.position());
  return {p.x(), p.y(), wrapAngle(heading + next.heading)};
}

Pose Pose::relative(const Pose& other) const {
  const Point p = inverseTransform(other.position());
  return {p.x(), p.y(), wrapAngle(other.heading - heading)};
}

}  // namespace tunnel_pilot::geometry
