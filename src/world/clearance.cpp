#include <algorithm>
#include <cmath>
#include <limits>

#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot::world {
namespace {

using geometry::Point;

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

double squaredDistance(const Point& p, const Point& a, const Point& b) {
  const Point ab = b - a;
  const double length2 = ab.squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((p - a).dot(ab) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * ab).squaredNorm();
}

bool segmentsCross(const Point& a, const Point& b, const Point& c, const Point& d) {
  return (cross(b - a, c - a) > 0.0) != (cross(b - a, d - a) > 0.0) &&
         (cross(d - c, a - c) > 0.0) != (cross(d - c, b - c) > 0.0);
}

// Segments that touch at an end have distance 0 from the four end points' distances.
double squaredDistance(const Point& a, const Point& b, const Point& c, const Point& d) {
  if (segmentsCross(a, b, c, d)) return 0.0;
  return std::min({squaredDistance(a, c, d), squaredDistance(b, c, d), squaredDistance(c, a, b),
                   squaredDistance(d, a, b)});
}

bool contains(const std::vector<Point>& polygon, const Point& p) {
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Point& a = polygon[i];
    const Point& b = polygon[j];
    if ((a.y() > p.y()) == (b.y() > p.y())) continue;
    if (p.x() < a.x() + (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y())) inside = !inside;
  }
  return inside;
}

}  // namespace

double clearance(const std::vector<Point>& polygon, const std::vector<WallChain>& walls) {
  const double infinity = std::numeric_limits<double>::infinity();
  if (polygon.empty()) return infinity;
  Point centre = Point::Zero();
  for (const Point& p : polygon) centre += p / static_cast<double>(polygon.size());
  double radius = 0.0;
  for (const Point& p : polygon) radius = std::max(radius, (p - centre).norm());
  double best = infinity;  // squared
  double near = infinity;  // squared distance from the centre within which a segment may be nearer
  for (const WallChain& chain : walls) {
    if (!chain.empty() && contains(polygon, chain.front())) return 0.0;
    for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
      if (squaredDistance(centre, chain[k], chain[k + 1]) >= near) continue;
      for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
        best = std::min(best, squaredDistance(polygon[j], polygon[i], chain[k], chain[k + 1]));
      }
      if (best == 0.0) return 0.0;
      near = std::pow(std::sqrt(best) + radius, 2);
    }
  }
  return std::sqrt(best);
}

}  // namespace tunnel_pilot::world
