#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::geometry {

/// One sweep of a planar lidar, in its own frame, with the meanings of REP-117: a finite value inside
/// [range_min, range_max] is a return; +infinity is "nothing within range_max"; -infinity is "too
/// close"; NaN is "no measurement". Beam i points to angle_min + i * angle_increment.
struct Scan {
  Stamp stamp{};                 ///< time of the first beam
  double angle_min = 0.0;        ///< [rad]
  double angle_increment = 0.0;  ///< [rad], positive: counter-clockwise
  double time_increment = 0.0;   ///< time between beams [s]
  double range_min = 0.0;        ///< [m]
  double range_max = 0.0;        ///< [m]
  std::vector<float> ranges;     ///< [m]
  /// Angle of the last beam as the sensor announced it [rad], to check the number of ranges against;
  /// NaN: not announced.
  double announced_angle_max = std::numeric_limits<double>::quiet_NaN();

  double angle(std::size_t i) const { return angle_min + static_cast<double>(i) * angle_increment; }
  double angleMax() const { return ranges.empty() ? angle_min : angle(ranges.size() - 1); }
};

}  // namespace tunnel_pilot::geometry
