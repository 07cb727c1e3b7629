#pragma once

#include <nav_msgs/Odometry.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/TunnelState.h>

#include <optional>
#include <string>

namespace tunnel_pilot::shell {

/// How grave it is what a StatusText tells: the colour it is written in.
enum class Gravity { kNormal, kStandby, kLimited, kStopped };

struct StatusText {
  std::string text;  ///< lines; empty when nothing is known
  Gravity gravity = Gravity::kNormal;
};

/// What is known lately; what is silent is left empty.
struct StatusInput {
  std::optional<TruckStatus> truck;
  std::optional<ArbiterState> arbiter;
  std::optional<TruckCommand> command;
  std::optional<TunnelState> tunnel;
  std::optional<nav_msgs::Odometry> odometry;
  std::optional<Proposal> network;  ///< lidar_driver's
};

/// The same in words, part by part; empty what is not known.
struct StatusParts {
  std::string state;       ///< safety state and mode
  std::string reason;      ///< the one reason why the truck does what it does
  std::string steered_by;  ///< who steers
  std::string network;     ///< how sure it is
  std::string speed;       ///< driven and asked for, and what limits it
  std::string free;        ///< distance that is free, and the one that a stop takes
  std::string place;       ///< in the tunnel, or why that is not known
  std::string shape;       ///< of the tunnel
  Gravity gravity = Gravity::kNormal;
};

StatusParts partsOf(const StatusInput& input);

/// What an operator wants to read beside the truck: the parts, one below the other.
StatusText describe(const StatusInput& input);

/// The one reason why the truck does what it does: the bridge's once it stops the truck, while it does
/// not hear the truck, and where the arbiter finds nothing wrong; else the arbiter's. Empty when neither
/// is known.
std::string reasonInWords(const StatusInput& input);
Gravity gravity(const StatusInput& input);
/// "lidar_driver" as "lidar driver".
std::string words(std::string name);

}  // namespace tunnel_pilot::shell
