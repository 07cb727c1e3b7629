#include "tunnel_pilot/can/profile.h"

#include <utility>

#include "tunnel_pilot/can/layout.h"

namespace tunnel_pilot::can {
namespace {

template <class Field>
void readField(config::Node& node, const char* key, int bits, Field& field) {
  field = static_cast<Field>(node.integer(key, "1", 0, (std::int64_t{1} << bits) - 1));
}

std::uint64_t loadName(config::Node node) {
  J1939Name name;
  readField(node, "identity_number", 21, name.identity_number);
  readField(node, "manufacturer_code", 11, name.manufacturer_code);
  readField(node, "ecu_instance", 3, name.ecu_instance);
  readField(node, "function_instance", 5, name.function_instance);
  readField(node, "function", 8, name.function);
  readField(node, "vehicle_system", 7, name.vehicle_system);
  readField(node, "vehicle_system_instance", 4, name.vehicle_system_instance);
  readField(node, "industry_group", 3, name.industry_group);
  node.finish();
  return toNumber(name);
}

J1939Parameters loadJ1939(config::Node node, Side side) {
  const std::string partner = side == Side::kPilot ? "truck_address" : "pilot_address";
  J1939Parameters p;
  p.side = side;
  p.source_address = static_cast<std::uint8_t>(node.integer("source_address", "1", 0, kMaxAddress));
  p.partner_address = static_cast<std::uint8_t>(node.integer(partner, "1", 0, kMaxAddress));
  if (p.partner_address == p.source_address) node.refuse(partner, "must differ from source_address");
  p.name = loadName(node.child("name"));
  node.finish();
  return p;
}

}  // namespace

std::string toString(ProfileKind kind) { return kind == ProfileKind::kJ1939 ? "j1939" : "plain"; }

ProfileKind readProfileKind(config::Node& node, const std::string& key) {
  return node.choice(key, {"plain", "j1939"}) == "j1939" ? ProfileKind::kJ1939 : ProfileKind::kPlain;
}

Profile loadProfile(config::Node& node, Side side) {
  Profile profile;
  profile.kind = readProfileKind(node, "profile");
  profile.j1939 = loadJ1939(node.child("j1939"), side);
  return profile;
}

void requireAgreement(const Profile& pilot, const Profile& truck) {
  if (pilot.kind != truck.kind) {
    throw config::ConfigError("profile: the pilot's is " + toString(pilot.kind) + ", the truck's " +
                              toString(truck.kind));
  }
  const bool meet = pilot.j1939.source_address == truck.j1939.partner_address &&
                    pilot.j1939.partner_address == truck.j1939.source_address;
  if (pilot.kind == ProfileKind::kJ1939 && !meet) {
    throw config::ConfigError("j1939: pilot and truck do not expect each other's source_address");
  }
}

std::unique_ptr<Bus> withProfile(const Profile& profile, std::unique_ptr<Bus> bus) {
  if (profile.kind == ProfileKind::kPlain) return bus;
  return std::make_unique<J1939Bus>(profile.j1939, std::move(bus));
}

std::vector<Identifier> identifiersOf(const Profile& profile) {
  if (profile.kind == ProfileKind::kJ1939) return j1939Identifiers(profile.j1939);
  std::vector<Identifier> identifiers;
  for (const FrameLayout& layout : frameLayouts()) identifiers.push_back({layout.id, false});
  return identifiers;
}

}  // namespace tunnel_pilot::can
