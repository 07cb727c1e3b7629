#pragma once

#include <array>

namespace tunnel_pilot::shell {

/// The names of the pilot's nodes and nodelets that have parameters, as the launch files start them.
inline constexpr std::array kPilotNodes = {"scan_filter",    "wall_segmentation", "centerline",
                                           "preview_driver", "lidar_driver",      "arbiter",
                                           "can_bridge"};

}  // namespace tunnel_pilot::shell
