#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::geometry {

/// One sample of a planar path.
struct PathPoint {
  double s = 0.0;          ///< arc length from the path's start [m]
  double x = 0.0;          ///< [m]
  double y = 0.0;          ///< [m]
  double heading = 0.0;    ///< tangent direction [rad]
  double curvature = 0.0;  ///< d(heading)/ds, positive to the left [1/m]
};

/// Where a point lies beside a path.
struct PathProjection {
  double s = 0.0;               ///< arc length of the foot point [m]
  double lateral_offset = 0.0;  ///< signed distance left of the path [m]
  double heading = 0.0;         ///< path direction at the foot point [rad]
  double curvature = 0.0;       ///< path curvature at the foot point [1/m]
};

/// A sampled path (a tunnel's design line, a measured centerline, a planned lane change), with linear
/// interpolation between samples. s grows strictly; a closed path's first and last sample coincide and s
/// wraps round. Throws std::invalid_argument for fewer than two points, non-finite numbers or s that
/// does not grow.
class Path {
 public:
  Path() = default;
  explicit Path(std::vector<PathPoint> points, bool closed = false);

  bool empty() const { return points_.empty(); }
  bool closed() const { return closed_; }
  double length() const;  ///< [m], 0 when empty
  const std::vector<PathPoint>& points() const { return points_; }

  /// Interpolated sample at arc length `s` [m]; clamped to the ends of an open path, wrapped on a closed
  /// one. Must not be called on an empty path.
  PathPoint at(double s) const;

  /// Foot point of `point` nearest to it. Beyond an open path's ends the end tangents are prolonged (s
  /// may then be negative or exceed length()). With a hint, only the neighbourhood `window` [m] of
  /// arc length around it is searched, which keeps crossing or returning branches apart.
  PathProjection project(const Point& point) const;
  PathProjection project(const Point& point, double s_hint, double window = 10.0) const;

 private:
  std::size_t segmentAt(double s) const;
  PathProjection projectRange(const Point& point, std::size_t first, std::size_t last) const;

  std::vector<PathPoint> points_;
  bool closed_ = false;
};

/// One piece of a design line. Curvature runs linearly from its start to its end value, so that the
/// kinds are: straight (0, 0), arc (k, k), clothoid (anything else).
struct PathPiece {
  double length = 0.0;           ///< [m], positive
  double curvature_start = 0.0;  ///< [1/m]
  double curvature_end = 0.0;    ///< [1/m]
};

/// Samples a list of pieces every `spacing` [m] (the joints between pieces are always samples), starting
/// at `start`. The heading is exact; positions are integrated with Gauss-Legendre quadrature (error
/// below 1e-9 m a metre for curvatures up to 1/m). `closed` only marks the result: use closureGap() to
/// judge it.
Path buildPath(const std::vector<PathPiece>& pieces, const Pose& start, double spacing,
               bool closed = false);

/// Distance between a path's last and first sample [m].
double closureGap(const Path& path);

}  // namespace tunnel_pilot::geometry
