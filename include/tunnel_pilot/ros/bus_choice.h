#pragma once

#include <memory>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {

/// The bus that the parameters name, taken off them: either `bus` (name of an embedded one) or
/// `interface` (of SocketCAN, such as can0). `simulated_time` (use_sim_time) never drives a real truck:
/// it is refused with an interface. The bus speaks the profile of the bridge's parameters. Throws
/// config::ConfigError, and std::exception when there is no such bus.
std::unique_ptr<can::Bus> takeBus(Parameters& parameters, bool simulated_time);

}  // namespace tunnel_pilot::shell
