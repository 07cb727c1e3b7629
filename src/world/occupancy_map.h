#pragma once

#include <string>
#include <vector>

#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::world {

/// Walls of a map_server YAML (image, resolution, origin, negate, occupied_thresh, free_thresh; trinary)
/// and its image: the outlines of the occupied regions, through the centres of their outermost cells,
/// simplified to within half a cell. Unknown cells are no walls. Throws ConfigError.
std::vector<WallChain> loadOccupancyMap(const std::string& file);

}  // namespace tunnel_pilot::world
