#include "tunnel_pilot/ros/bus_choice.h"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/socket_can_bus.h"

namespace tunnel_pilot::shell {
namespace {

/// The helper stands beside the node that runs.
std::string helper() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / "can_link_cycle";
}

std::unique_ptr<can::Bus> joinInterface(const std::string& interface) {
  std::vector<can::Identifier> listen;
  for (const can::FrameLayout& layout : can::frameLayouts()) listen.push_back({layout.id, false});
  return std::make_unique<can::SocketCanBus>(interface, listen, can::openCanSocket(interface, helper()));
}

}  // namespace

std::unique_ptr<can::Bus> takeBus(Parameters& parameters, bool simulated_time) {
  config::Node node = parameters.take({"bus", "interface"});
  if (!node.has("interface")) return std::make_unique<can::EmbeddedBus>(node.text("bus"));
  const std::string interface = node.text("interface");
  if (node.has("bus")) {
    throw config::ConfigError("interface: there is a bus, too; give the name of an embedded bus or a " +
                              std::string("SocketCAN interface"));
  }
  if (simulated_time) {
    throw config::ConfigError("interface: '" + interface +
                              "' is not driven in simulated time: use_sim_time is set");
  }
  return joinInterface(interface);
}

}  // namespace tunnel_pilot::shell
