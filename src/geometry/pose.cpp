#include "tunnel_pilot/geometry/pose.h"

#include <cmath>

namespace tunnel_pilot::geometry {

double wrapAnyAngle(double angle) {
  const double wrapped = std::remainder(angle, 2.0 * M_PI);
  return wrapped <= -M_PI ? wrapped + 2.0 * M_PI : wrapped;
}

Point Pose::transform(const Point& local) const { return Frame(*this).transform(local); }

Point Pose::inverseTransform(const Point& parent) const { return Frame(*this).inverseTransform(parent); }

Pose Pose::compose(const Pose& next) const { return Frame(*this).compose(next); }

Pose Pose::relative(const Pose& other) const {
  const Point p = inverseTransform(other.position());
  return {p.x(), p.y(), wrapAngle(other.heading - heading)};
}

}  // namespace tunnel_pilot::geometry
