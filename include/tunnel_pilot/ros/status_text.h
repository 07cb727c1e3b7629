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

/// What an operator wants to read beside the truck: the safety state and mode, the one reason why it
/// does what it does, who steers and how sure the network is, the speed and what limits it, the distance
/// that is free and the one that a stop takes, and where the truck is in the tunnel or why that is not
/// known.
StatusText describe(const StatusInput& input);

/// The one reason why the truck does what it does: the bridge's once it stops the truck, else the
/// arbiter's. Empty when neither is known.
std::string reasonInWords(const StatusInput& input);
Gravity gravity(const StatusInput& input);
/// "lidar_driver" as "lidar driver".
std::string words(std::string name);

}  // namespace tunnel_pilot::shell
