#include "tunnel_pilot/simulation/clearance_meter.h"

#include <algorithm>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

using geometry::Point;

constexpr std::size_t kChunkSegments = 32;

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

double pointToSegment(const Point& p, const Point& a, const Point& b) {
  const Point along = b - a;
  const double length_squared = along.squaredNorm();
  const double share =
      length_squared > 0.0 ? std::clamp((p - a).dot(along) / length_squared, 0.0, 1.0) : 0.0;
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

double outlineToSegment(const std::vector<Point>& outline, const Point& c, const Point& d) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    nearest = std::min(nearest, segmentToSegment(outline[i], outline[(i + 1) % outline.size()], c, d));
  }
  return nearest;
}

// True when a circle round `a` may come nearer than `distance` to one round `b`.
bool mayBeNearer(const Point& a, const Point& b, double radii, double distance) {
  const double reach = distance + radii;
  return (a - b).squaredNorm() < reach * reach;
}

}  // namespace

// Circle round the points' bounding box.
ClearanceMeter::Circle ClearanceMeter::boundingCircle(const Point* points, std::size_t count) {
  Point low = points[0];
  Point high = points[0];
  for (std::size_t i = 1; i < count; ++i) {
    low = low.cwiseMin(points[i]);
    high = high.cwiseMax(points[i]);
  }
  return {0.5 * (low + high), 0.5 * (high - low).norm()};
}

ClearanceMeter::ClearanceMeter(const std::vector<world::WallChain>& walls) {
  for (const world::WallChain& wall : walls) {
    for (std::size_t first = 0; first + 1 < wall.size(); first += kChunkSegments) {
      const std::size_t last = std::min(first + kChunkSegments, wall.size() - 1);
      Chunk chunk{boundingCircle(&wall[first], last - first + 1), {}};
      for (std::size_t i = first; i < last; ++i) {
        chunk.segments.push_back({boundingCircle(&wall[i], 2), wall[i], wall[i + 1]});
      }
      chunks_.push_back(std::move(chunk));
    }
  }
}

double ClearanceMeter::clearance(const std::vector<Point>& outline) const {
  const Circle body = boundingCircle(outline.data(), outline.size());
  double nearest = std::numeric_limits<double>::infinity();
  const auto look = [&](const Chunk& chunk) {
    for (const Segment& segment : chunk.segments) {
      if (!mayBeNearer(segment.circle.centre, body.centre, segment.circle.radius + body.radius, nearest))
        continue;
      nearest = std::min(nearest, outlineToSegment(outline, segment.a, segment.b));
    }
  };
  // The chunk that seems nearest first: it rules most of the others out.
  const auto power = [&](const Chunk& chunk) {
    return (chunk.circle.centre - body.centre).squaredNorm() - chunk.circle.radius * chunk.circle.radius;
  };
  const auto first =
      std::min_element(chunks_.begin(), chunks_.end(),
                       [&](const Chunk& a, const Chunk& b) { return power(a) < power(b); });
  if (first != chunks_.end()) look(*first);
  for (const Chunk& chunk : chunks_) {
    if (&chunk == &*first) continue;
    if (mayBeNearer(chunk.circle.centre, body.centre, chunk.circle.radius + body.radius, nearest))
      look(chunk);
  }
  return nearest;
}

}  // namespace tunnel_pilot::simulation
