#include "tunnel_pilot/simulation/clearance_meter.h"

#include <algorithm>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

using geometry::Point;

constexpr std::size_t kChunkSegments = 12;

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

double pointToSegment(const Point& p, const Point& a, const Point& b) {
  const Point along = b - a;
  const double length_squared = along.squaredNorm();
  const double share = length_squared > 0.0 ? std::clamp((p - a).dot(along) / length_squared, 0.0, 1.0) : 0.0;
  return (a + share * along - p).norm();
}

bool segmentsCross(const Point& a, const Point& b, const Point& c, const Point& d) {
  const double side_a = cross(d - c, a - c);
  const double side_b = cross(d - c, b - c);
  const double side_c = cross(b - a, c - a);
  const double side_d = cross(b - a, d - a);
  return side_a * side_b < 0.0 && side_c * side_d < 0.0;
}

double segmentToSegment(const Point& a, const Point& b, const Point& c, const Point& d) {
  if (segmentsCross(a, b, c, d)) return 0.0;
  return std::min({pointToSegment(a, c, d), pointToSegment(b, c, d), pointToSegment(c, a, b),
                   pointToSegment(d, a, b)});
}

double outlineToChain(const std::vector<Point>& outline, const world::WallChain& chain) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Point& a = outline[i];
    const Point& b = outline[(i + 1) % outline.size()];
    for (std::size_t j = 0; j + 1 < chain.size(); ++j) {
      nearest = std::min(nearest, segmentToSegment(a, b, chain[j], chain[j + 1]));
    }
  }
  return nearest;
}

// Circle round the points' bounding box.
void boundingCircle(const std::vector<Point>& points, Point& centre, double& radius) {
  Point low = points.front();
  Point high = points.front();
  for (const Point& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  centre = 0.5 * (low + high);
  radius = 0.5 * (high - low).norm();
}

}  // namespace

ClearanceMeter::ClearanceMeter(const std::vector<world::WallChain>& walls) {
  for (const world::WallChain& wall : walls) {
    for (std::size_t first = 0; first + 1 < wall.size(); first += kChunkSegments) {
      const std::size_t last = std::min(first + kChunkSegments, wall.size() - 1);
      Chunk chunk;
      chunk.points.assign(wall.begin() + static_cast<std::ptrdiff_t>(first),
                          wall.begin() + static_cast<std::ptrdiff_t>(last) + 1);
      boundingCircle(chunk.points, chunk.centre, chunk.radius);
      chunks_.push_back(std::move(chunk));
    }
  }
}

double ClearanceMeter::clearance(const std::vector<Point>& outline) const {
  Point centre;
  double radius = 0.0;
  boundingCircle(outline, centre, radius);
  const auto atLeast = [&](const Chunk& chunk) {
    return (chunk.centre - centre).norm() - chunk.radius - radius;
  };
  // The chunk that seems nearest first: it rules most of the others out.
  const auto first = std::min_element(chunks_.begin(), chunks_.end(), [&](const Chunk& a, const Chunk& b) {
    return atLeast(a) < atLeast(b);
  });
  if (first == chunks_.end()) return std::numeric_limits<double>::infinity();
  double nearest = outlineToChain(outline, first->points);
  for (const Chunk& chunk : chunks_) {
    if (&chunk != &*first && atLeast(chunk) < nearest) {
      nearest = std::min(nearest, outlineToChain(outline, chunk.points));
    }
  }
  return nearest;
}

}  // namespace tunnel_pilot::simulation
