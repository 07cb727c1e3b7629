#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::simulation {

/// Distance from a body's outline to the walls, as world::clearance() gives it, but fast enough for
/// every few steps: walls are cut into chunks with bounding circles, and only the chunks that can hold
/// the nearest segment are looked at. Does not see a body that lies wholly inside a closed chain.
class ClearanceMeter {
 public:
  explicit ClearanceMeter(const std::vector<world::WallChain>& walls);

  /// Smallest distance from any edge of the closed polygon `outline` to any wall [m]; 0 when they cross;
  /// infinity without walls.
  double clearance(const std::vector<geometry::Point>& outline) const;

 private:
  struct Circle {
    geometry::Point centre;
    double radius;
  };
  struct Segment {
    Circle circle;
    geometry::Point a, b;
  };
  struct Chunk {
    Circle circle;
    std::vector<Segment> segments;
  };
  static Circle boundingCircle(const geometry::Point* points, std::size_t count);

  std::vector<Chunk> chunks_;
};

}  // namespace tunnel_pilot::simulation
