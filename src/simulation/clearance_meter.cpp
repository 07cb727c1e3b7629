#include "tunnel_pilot/simulation/clearance_meter.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

using geometry::Point;

constexpr std::size_t kChunkSegments = 32;

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

double squaredDistance(const Point& p, const ClearanceMeter::Edge& edge) {
  const Point from_start = p - edge.start;
  const double share = std::clamp(from_start.dot(edge.along) * edge.inverse_squared_length, 0.0, 1.0);
  return (share * edge.along - from_start).squaredNorm();
}

bool edgesCross(const ClearanceMeter::Edge& a, const ClearanceMeter::Edge& b) {
  const Point between = b.start - a.start;
  const double side_start = cross(a.along, between);
  const double side_end = cross(a.along, between + b.along);
  const double other_start = cross(b.along, -between);
  const double other_end = cross(b.along, a.along - between);
  return side_start * side_end < 0.0 && other_start * other_end < 0.0;
}

double squaredDistance(const ClearanceMeter::Edge& a, const ClearanceMeter::Edge& b) {
  if (edgesCross(a, b)) return 0.0;
  return std::min({squaredDistance(a.start, b), squaredDistance(a.start + a.along, b),
                   squaredDistance(b.start, a), squaredDistance(b.start + b.along, a)});
}

double distance(const Point& p, const std::vector<ClearanceMeter::Edge>& outline) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const ClearanceMeter::Edge& edge : outline) nearest = std::min(nearest, squaredDistance(p, edge));
  return std::sqrt(nearest);
}

double distance(const ClearanceMeter::Edge& wall, const std::vector<ClearanceMeter::Edge>& outline) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const ClearanceMeter::Edge& edge : outline)
    nearest = std::min(nearest, squaredDistance(edge, wall));
  return std::sqrt(nearest);
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

ClearanceMeter::Edge ClearanceMeter::edgeBetween(const Point& a, const Point& b) {
  const double squared_length = (b - a).squaredNorm();
  return {a, b - a, squared_length > 0.0 ? 1.0 / squared_length : 0.0};
}

ClearanceMeter::ClearanceMeter(const std::vector<world::WallChain>& walls) {
  for (const world::WallChain& wall : walls) {
    for (std::size_t first = 0; first + 1 < wall.size(); first += kChunkSegments) {
      const std::size_t last = std::min(first + kChunkSegments, wall.size() - 1);
      Chunk chunk{boundingCircle(&wall[first], last - first + 1), {}};
      for (std::size_t i = first; i < last; ++i) {
        chunk.segments.push_back({boundingCircle(&wall[i], 2), edgeBetween(wall[i], wall[i + 1])});
      }
      chunks_.push_back(std::move(chunk));
    }
  }
}

double ClearanceMeter::clearance(const std::vector<Point>& outline) const {
  const Circle body = boundingCircle(outline.data(), outline.size());
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    edges.push_back(edgeBetween(outline[i], outline[(i + 1) % outline.size()]));
  }
  double nearest = std::numeric_limits<double>::infinity();
  const auto look = [&](const Chunk& chunk) {
    for (const Segment& segment : chunk.segments) {
      const Circle& circle = segment.circle;
      if (!mayBeNearer(circle.centre, body.centre, circle.radius + body.radius, nearest)) continue;
      if (distance(circle.centre, edges) - circle.radius >= nearest) continue;
      nearest = std::min(nearest, distance(segment.edge, edges));
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
