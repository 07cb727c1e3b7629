#include "tunnel_pilot/simulation/clearance_meter.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

using geometry::Point;

constexpr std::size_t kChunkSegments = 16;

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

double distance(const ClearanceMeter::Edge& wall, const std::vector<ClearanceMeter::Edge>& outline) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const ClearanceMeter::Edge& edge : outline)
    nearest = std::min(nearest, squaredDistance(edge, wall));
  return std::sqrt(nearest);
}

// Box round an outline, in line with its first edge (for a truck's body the outline itself): nothing is
// nearer to the outline than to the box.
class Box {
 public:
  explicit Box(const std::vector<ClearanceMeter::Edge>& outline) : along_(1.0, 0.0) {
    const double length = outline.front().along.norm();
    if (length > 0.0) along_ = outline.front().along / length;
    Point low = turned(outline.front().start);
    Point high = low;
    for (const ClearanceMeter::Edge& edge : outline) {
      low = low.cwiseMin(turned(edge.start));
      high = high.cwiseMax(turned(edge.start));
    }
    middle_ = 0.5 * (low + high);
    half_ = 0.5 * (high - low);
  }

  // Seen from the box: its axes are those of the box, its origin the box's middle.
  Point local(const Point& p) const { return turned(p) - middle_; }

  double squaredDistance(const Point& local) const {
    return (local.cwiseAbs() - half_).cwiseMax(0.0).squaredNorm();
  }

  // Squared distance to the upright rectangle that has these corners: no part of the straight line
  // between them is nearer.
  double squaredDistance(const Point& a, const Point& b) const {
    const Point above = a.cwiseMin(b) - half_;
    const Point below = -a.cwiseMax(b) - half_;
    return above.cwiseMax(below).cwiseMax(0.0).squaredNorm();
  }

 private:
  Point turned(const Point& p) const { return {along_.dot(p), cross(along_, p)}; }

  Point along_;
  Point middle_;
  Point half_;
};

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
      const std::size_t count = last - first + 1;
      Chunk chunk{boundingCircle(&wall[first], count), {&wall[first], &wall[first] + count}, {}};
      for (std::size_t i = first; i < last; ++i) {
        chunk.edges.push_back(edgeBetween(wall[i], wall[i + 1]));
      }
      chunks_.push_back(std::move(chunk));
    }
  }
}

double ClearanceMeter::clearance(const std::vector<Point>& outline) {
  std::vector<Edge> edges;
  edges.reserve(outline.size());
  for (std::size_t i = 0; i < outline.size(); ++i) {
    edges.push_back(edgeBetween(outline[i], outline[(i + 1) % outline.size()]));
  }
  if (chunks_.empty()) return std::numeric_limits<double>::infinity();
  const Box box(edges);
  // The edge that was nearest last time still is or nearly so, which rules most of the others out.
  double nearest = distance(chunks_[nearest_chunk_].edges[nearest_edge_], edges);
  const auto measure = [&](std::size_t index) {
    const Chunk& chunk = chunks_[index];
    Point before = box.local(chunk.vertices.front());
    for (std::size_t i = 0; i < chunk.edges.size(); ++i) {
      const Point after = box.local(chunk.vertices[i + 1]);
      const bool may_be_nearer = box.squaredDistance(before, after) < nearest * nearest;
      before = after;
      if (!may_be_nearer) continue;
      const double found = distance(chunk.edges[i], edges);
      if (found >= nearest) continue;
      nearest = found;
      nearest_chunk_ = index;
      nearest_edge_ = i;
    }
  };
  for (std::size_t i = 0; i < chunks_.size(); ++i) {
    const Circle& circle = chunks_[i].circle;
    const double reach = nearest + circle.radius;
    if (box.squaredDistance(box.local(circle.centre)) < reach * reach) measure(i);
  }
  return nearest;
}

}  // namespace tunnel_pilot::simulation
