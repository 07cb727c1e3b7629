#pragma once

#include <cstdint>
#include <cstdlib>

namespace tunnel_pilot::bridge {

/// A number that scripts/can_machine hands over.
inline long option(const char* name, long otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr || *value == '\0' ? otherwise : std::strtol(value, nullptr, 10);
}

/// How often a fault is provoked: as often as was asked for, else by the set that is run.
inline int times(int few, int many) {
  const bool is_long = option("CAN_MACHINE_LONG", 0) == 1;
  return static_cast<int>(option("CAN_MACHINE_CYCLES", is_long ? many : few));
}

inline std::uint32_t seed() { return static_cast<std::uint32_t>(option("CAN_MACHINE_SEED", 1)); }

}  // namespace tunnel_pilot::bridge
