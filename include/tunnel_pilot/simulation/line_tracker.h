#pragma once

#include <optional>

#include "tunnel_pilot/geometry/path.h"

namespace tunnel_pilot::simulation {

/// Follows a moving point along a line: its foot point is looked for near the last one, and its station
/// grows without wrapping on a closed line. The line must outlive the tracker and not be empty.
class LineTracker {
 public:
  explicit LineTracker(const geometry::Path& line) : line_(&line) {}

  /// The next projection looks at the whole line, and its station starts anew.
  void reset() { last_.reset(); }

  /// Foot point of `point`; `s` [m] is the station.
  geometry::PathProjection update(const geometry::Point& point);

 private:
  const geometry::Path* line_;
  std::optional<geometry::PathProjection> last_;  ///< with wrapped s
  double turns_ = 0.0;                            ///< lengths passed [1]
};

}  // namespace tunnel_pilot::simulation
