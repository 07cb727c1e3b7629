#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "tunnel_pilot/geometry/path.h"

namespace tunnel_pilot::drivers {

/// Reads a path's heading at arc lengths that grow from call to call, from `start` [m] on, without
/// searching. Beyond the end
/// of an open path the last curvature goes on; before its start the first one does. Headings are not
/// wrapped: their differences over arc length are mean curvatures. The path must outlive the cursor and
/// not be empty.
class PathCursor {
 public:
  PathCursor(const geometry::Path& path, double start) : points_(path.points()) {
    const auto after = std::upper_bound(points_.begin() + 1, points_.end() - 1, start,
                                        [](double s, const geometry::PathPoint& p) { return s < p.s; });
    segment_ = static_cast<std::size_t>(after - points_.begin()) - 1;
    heading_ = points_[segment_].heading;
  }

  double headingAt(double s) {
    while (segment_ + 2 < points_.size() && s > points_[segment_ + 1].s) {
      heading_ += turn();
      ++segment_;
    }
    const geometry::PathPoint& a = points_[segment_];
    const geometry::PathPoint& b = points_[segment_ + 1];
    if (s > b.s) return heading_ + turn() + (s - b.s) * b.curvature;
    if (s < a.s) return heading_ + (s - a.s) * a.curvature;
    return heading_ + turn() * (s - a.s) / (b.s - a.s);
  }

 private:
  double turn() const {
    const double turn = points_[segment_ + 1].heading - points_[segment_].heading;
    return std::abs(turn) < M_PI ? turn : geometry::wrapAngle(turn);
  }

  const std::vector<geometry::PathPoint>& points_;
  std::size_t segment_ = 0;
  double heading_;  ///< unwrapped, at the segment's start [rad]
};

}  // namespace tunnel_pilot::drivers
