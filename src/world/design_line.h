#pragma once

#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/path.h"

namespace tunnel_pilot::world {

/// Reads the list `design_line` of a world file: maps with one key each,
///   straight: {length [m]}
///   arc:      {radius [m], angle [rad], turn: left | right}
///   clothoid: {length [m]}              from the curvature of the piece before to that of the next
///   bend:     {radius [m], angle [rad], turn: left | right, transition [m]}
///                                       clothoid, arc, clothoid that turn by `angle` in all
/// On a closed line two straights may have no length and one arc or bend no angle: they are solved so
/// that the line closes. Throws ConfigError; also when a closed line misses its start.
std::vector<geometry::PathPiece> readDesignLine(config::Node& world, bool closed);

}  // namespace tunnel_pilot::world
