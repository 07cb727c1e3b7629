#include "tunnel_pilot/geometry/path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace tunnel_pilot::geometry {
namespace {

// Nodes and weights of the five-point Gauss-Legendre rule on [-1, 1].
constexpr std::array<double, 5> kNodes = {-0.906179845938664, -0.538469310105683, 0.0, 0.538469310105683,
                                          0.906179845938664};
constexpr std::array<double, 5> kWeights = {0.236926885056189, 0.478628670499366, 0.568888888888889,
                                            0.478628670499366, 0.236926885056189};

// Moves along a curve of linearly changing curvature, starting at `from`, by `length`.
PathPoint advance(const PathPoint& from, double length, double curvature_rate) {
  PathPoint to = from;
  const double half = 0.5 * length;
  for (std::size_t i = 0; i < kNodes.size(); ++i) {
    const double u = half * (1.0 + kNodes[i]);
    const double heading = from.heading + u * (from.curvature + 0.5 * curvature_rate * u);
    to.x += half * kWeights[i] * std::cos(heading);
    to.y += half * kWeights[i] * std::sin(heading);
  }
  to.s = from.s + length;
  to.heading = from.heading + length * (from.curvature + 0.5 * curvature_rate * length);
  to.curvature = from.curvature + curvature_rate * length;
  return to;
}

void checkPoint(const PathPoint& p, std::size_t i) {
  if (!(std::isfinite(p.s) && std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.heading) &&
        std::isfinite(p.curvature))) {
    throw std::invalid_argument("path point " + std::to_string(i) + " is not finite");
  }
}

double interpolateAngle(double a, double b, double t) { return a + t * wrapAngle(b - a); }

}  // namespace

Path::Path(std::vector<PathPoint> points, bool closed) : points_(std::move(points)), closed_(closed) {
  if (points_.size() < 2) throw std::invalid_argument("a path needs at least two points");
  for (std::size_t i = 0; i < points_.size(); ++i) {
    checkPoint(points_[i], i);
    if (i > 0 && !(points_[i].s > points_[i - 1].s)) {
      throw std::invalid_argument("path arc length does not grow at point " + std::to_string(i));
    }
  }
}

double Path::length() const { return points_.empty() ? 0.0 : points_.back().s - points_.front().s; }

std::size_t Path::segmentAt(double s) const {
  const auto after = std::upper_bound(points_.begin(), points_.end(), s,
                                      [](double value, const PathPoint& p) { return value < p.s; });
  const auto index = std::distance(points_.begin(), after) - 1;
  return static_cast<std::size_t>(
      std::clamp<std::ptrdiff_t>(index, 0, static_cast<std::ptrdiff_t>(points_.size()) - 2));
}

PathPoint Path::at(double s) const {
  const double start = points_.front().s;
  if (closed_) {
    s = start + std::fmod(s - start, length());
    if (s < start) s += length();
  }
  s = std::clamp(s, start, points_.back().s);
  const PathPoint& a = points_[segmentAt(s)];
  const PathPoint& b = *(&a + 1);
  const double t = (s - a.s) / (b.s - a.s);
  return {s, a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), interpolateAngle(a.heading, b.heading, t),
          a.curvature + t * (b.curvature - a.curvature)};
}

// Finds the nearest segment first: all that is told of the foot point is worked out for that one alone.
PathProjection Path::projectRange(const Point& point, std::size_t first, std::size_t last) const {
  double nearest = std::numeric_limits<double>::infinity();  // squared
  std::size_t segment = first;
  double share = 0.0;
  for (std::size_t i = first; i < last; ++i) {
    const PathPoint& a = points_[i];
    const PathPoint& b = points_[i + 1];
    const Point chord(b.x - a.x, b.y - a.y);
    const Point to_point(point.x() - a.x, point.y() - a.y);
    double t = to_point.dot(chord) / chord.squaredNorm();
    const bool open_start = !closed_ && i == 0;
    const bool open_end = !closed_ && i + 2 == points_.size();
    if (!open_start) t = std::max(t, 0.0);
    if (!open_end) t = std::min(t, 1.0);
    const double distance = (to_point - t * chord).squaredNorm();
    if (distance >= nearest) continue;
    nearest = distance;
    segment = i;
    share = t;
  }
  const PathPoint& a = points_[segment];
  const PathPoint& b = points_[segment + 1];
  const double side = (b.x - a.x) * (point.y() - a.y) - (b.y - a.y) * (point.x() - a.x);
  const double inside = std::clamp(share, 0.0, 1.0);
  return {a.s + share * (b.s - a.s), std::copysign(std::sqrt(nearest), side),
          interpolateAngle(a.heading, b.heading, inside),
          a.curvature + inside * (b.curvature - a.curvature)};
}

PathProjection Path::project(const Point& point) const {
  return projectRange(point, 0, points_.size() - 1);
}

PathProjection Path::project(const Point& point, double s_hint, double window) const {
  if (2.0 * window >= length()) return project(point);
  const double start = points_.front().s;
  const double end = points_.back().s;
  if (closed_) s_hint = start + std::fmod(std::fmod(s_hint - start, length()) + length(), length());
  const auto search = [&](double from, double to) {
    return projectRange(point, segmentAt(from), segmentAt(to) + 1);
  };
  PathProjection best = search(s_hint - window, s_hint + window);
  if (!closed_) return best;
  const auto take_if_nearer = [&](const PathProjection& other) {
    if (std::abs(other.lateral_offset) < std::abs(best.lateral_offset)) best = other;
  };
  if (s_hint - window < start) take_if_nearer(search(s_hint - window + length(), end));
  if (s_hint + window > end) take_if_nearer(search(start, s_hint + window - length()));
  return best;
}

Path buildPath(const std::vector<PathPiece>& pieces, const Pose& start, double spacing, bool closed) {
  if (!(spacing > 0.0)) throw std::invalid_argument("path spacing must be positive");
  std::vector<PathPoint> points;
  PathPoint joint{0.0, start.x, start.y, start.heading, 0.0};
  for (const PathPiece& piece : pieces) {
    if (!(piece.length > 0.0)) throw std::invalid_argument("path piece length must be positive");
    const double rate = (piece.curvature_end - piece.curvature_start) / piece.length;
    const int steps = std::max(1, static_cast<int>(std::ceil(piece.length / spacing - 1e-9)));
    joint.curvature = piece.curvature_start;
    points.push_back(joint);
    PathPoint p = joint;
    for (int k = 1; k <= steps; ++k) {
      p = advance(p, piece.length / steps, rate);
      if (k < steps) points.push_back(p);
    }
    joint = p;
  }
  points.push_back(joint);
  return Path(std::move(points), closed);
}

double closureGap(const Path& path) {
  const PathPoint& a = path.points().front();
  const PathPoint& b = path.points().back();
  return std::hypot(b.x - a.x, b.y - a.y);
}

}  // namespace tunnel_pilot::geometry
