#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/can_socket.h"
#include "tunnel_pilot/can/j1939_bus.h"
#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::can {

/// How the frames of the .dbc stand on the wire: with their 11-bit identifiers
/// (config/tunnel_pilot.dbc), or under J1939 (config/tunnel_pilot_j1939.dbc).
enum class ProfileKind { kPlain, kJ1939 };

std::string toString(ProfileKind kind);

/// A side's choice of profile, and who it is under J1939.
struct Profile {
  ProfileKind kind = ProfileKind::kPlain;
  J1939Parameters j1939;
};

/// Reads `key`, one of "plain" and "j1939". Throws config::ConfigError.
ProfileKind readProfileKind(config::Node& node, const std::string& key);

/// Reads the keys `profile` and `j1939` of a side's file; all of them must be there in either profile.
/// Throws config::ConfigError naming file, key, unit and range.
Profile loadProfile(config::Node& node, Side side);

/// Throws config::ConfigError when the two could not hear each other.
void requireAgreement(const Profile& pilot, const Profile& truck);

/// The bus as a side with this profile uses it.
std::unique_ptr<Bus> withProfile(const Profile& profile, std::unique_ptr<Bus> bus);

/// What a side must hear of a bus, its own frames' echoes included.
std::vector<Identifier> identifiersOf(const Profile& profile);

}  // namespace tunnel_pilot::can
