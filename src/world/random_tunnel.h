#pragma once

#include <cstdint>

#include "tunnel.h"
#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::world {

/// Reads the ranges of a `type: random_tunnel` file into `plan` (all but what every tunnel has) and
/// draws an open layout with its `plan.seed`: straights and bends to both sides, some bends followed at
/// once by their opposite, bays beside some straights. A layout whose parts come nearer to each other
/// than `separation` is drawn anew. Returns its walls. Throws ConfigError, also when no draw suits.
TunnelWalls drawRandomTunnel(config::Node& world, TunnelPlan& plan);

}  // namespace tunnel_pilot::world
