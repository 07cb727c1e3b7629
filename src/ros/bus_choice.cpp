#include "tunnel_pilot/ros/bus_choice.h"

#include <filesystem>
#include <stdexcept>
#include <string>

#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/can/socket_can_bus.h"

namespace tunnel_pilot::shell {
namespace {

/// The helper stands beside the node that runs.
std::string helper() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / "can_link_cycle";
}

std::unique_ptr<can::Bus> joinInterface(const std::string& interface, const can::Profile& profile) {
  return std::make_unique<can::SocketCanBus>(interface, can::identifiersOf(profile),
                                             can::openCanSocket(interface, helper()));
}

/// The stage's own loader reads the profile again, and refuses what else there is.
can::Profile profileOf(const Parameters& parameters) {
  config::Node rest = parameters.rest();
  return can::loadProfile(rest, can::Side::kPilot);
}

}  // namespace

std::unique_ptr<can::Bus> takeBus(Parameters& parameters, bool simulated_time) {
  config::Node node = parameters.take({"bus", "interface"});
  if (!node.has("interface")) {
    const std::string name = node.text("bus");
    return can::withProfile(profileOf(parameters), std::make_unique<can::EmbeddedBus>(name));
  }
  const std::string interface = node.text("interface");
  if (node.has("bus")) {
    throw config::ConfigError("interface: there is a bus, too; give the name of an embedded bus or a " +
                              std::string("SocketCAN interface"));
  }
  if (simulated_time) {
    throw config::ConfigError("interface: '" + interface +
                              "' is not driven in simulated time: use_sim_time is set");
  }
  const can::Profile profile = profileOf(parameters);
  return can::withProfile(profile, joinInterface(interface, profile));
}

}  // namespace tunnel_pilot::shell
