#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::simulation {

/// Distance from a body's outline to the walls, as world::clearance() gives it, but fast enough for
/// every few steps: walls are cut into chunks with bounding circles, and only the chunks that can hold
/// the nearest segment are looked at, beginning with the segment of the last time. Does not see a body
/// that lies wholly inside a closed chain.
class ClearanceMeter {
 public:
  explicit ClearanceMeter(const std::vector<world::WallChain>& walls);

  /// Smallest distance from any edge of the closed polygon `outline` to any wall [m]; 0 when they cross;
  /// infinity without walls.
  double clearance(const std::vector<geometry::Point>& outline);

  /// A straight edge, ready for distances to it; of no length, its inverse is 0.
  struct Edge {
    geometry::Point start;
    geometry::Point along;          ///< from start to end [m]
    double inverse_squared_length;  ///< [1/m^2]
  };

 private:
  struct Circle {
    geometry::Point centre;
    double radius;
  };
  struct Chunk {
    Circle circle;
    std::vector<geometry::Point> vertices;
    std::vector<Edge> edges;  ///< from each vertex to the next
  };
  static Edge edgeBetween(const geometry::Point& a, const geometry::Point& b);
  static Circle boundingCircle(const geometry::Point* points, std::size_t count);

  std::vector<Chunk> chunks_;
  std::size_t nearest_chunk_ = 0;  ///< of the last measurement, and ...
  std::size_t nearest_edge_ = 0;   ///< ... its edge
};

}  // namespace tunnel_pilot::simulation
