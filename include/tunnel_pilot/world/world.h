#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/path.h"

namespace tunnel_pilot::world {

/// A polyline of wall vertices [m] in the map frame; consecutive vertices share a wall segment.
using WallChain = std::vector<geometry::Point>;

/// A polygon that stands or moves in the world with constant velocity along a straight track, there and
/// back (a parked vehicle, a person).
struct Obstacle {
  std::string name;
  std::vector<geometry::Point> outline;  ///< closed polygon about its own origin [m]
  geometry::Pose start;                  ///< pose at time 0
  double speed = 0.0;                    ///< along start.heading [m/s]
  double travel = 0.0;                   ///< turns back after this distance [m]; 0: never

  geometry::Pose poseAt(double time) const;
  WallChain chainAt(double time) const;  ///< outline in the map frame, closed, time [s]
};

/// Walls, obstacles and, where the world was designed as a tunnel, its design line (the truth that
/// lateral offset and heading error are measured against).
struct World {
  std::string name;
  std::vector<WallChain> walls;
  std::vector<Obstacle> obstacles;
  geometry::Path design_line;  ///< empty for a map without one
  double width = 0.0;          ///< nominal distance between the walls [m]
  std::vector<double> widths;  ///< distance between the walls at the design line's points, openings left
                               ///< out [m]; empty where it is the nominal one throughout
  geometry::Pose start;        ///< where a truck's front axle is put

  /// Distance between the walls beside the design line's station `s` [m], interpolated, without
  /// roughness.
  double widthAt(double s) const;
};

/// What may be overridden when the same world file is used for many seeds and both ways round.
struct WorldOptions {
  std::optional<std::uint64_t> seed;  ///< wall roughness and, in randomised worlds, the layout
  bool reversed = false;              ///< design line and start turned round
};

/// Reads a world file: `type: tunnel` (list of straights, arcs, clothoids), `type: random_tunnel`
/// (a seeded layout drawn from ranges) or `type: map` (a map_server YAML with its image, its occupied
/// regions' outlines made walls with OpenCV). docs/worlds.md has the keys. Throws config::ConfigError
/// naming file, key, unit, range.
World loadWorld(const std::string& file, const WorldOptions& options = {});

}  // namespace tunnel_pilot::world
