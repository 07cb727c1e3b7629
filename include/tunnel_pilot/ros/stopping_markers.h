#pragma once

#include <tunnel_pilot/ArbiterState.h>
#include <visualization_msgs/Marker.h>

#include <vector>

namespace tunnel_pilot::shell {

/// How far the way is free and how far the truck needs to stop, as the arbiter tells both: two bands on
/// the ground from the nose along the middle of the swept corridor, each with a gate that stands at its
/// end. free_distance is narrow and white; stopping_distance is wide, red where 0.5 m or less are left
/// to the end of what is free, yellow at 2 m, green at 3.5 m (with the arbiter's own numbers as shipped:
/// a stop; where the governor holds the speed for it; room). What has no length or is unknown is
/// removed. `front_overhang`: of the nose before the front axle [m].
std::vector<visualization_msgs::Marker> stoppingMarkers(const ArbiterState& state,
                                                        double front_overhang);

}  // namespace tunnel_pilot::shell
