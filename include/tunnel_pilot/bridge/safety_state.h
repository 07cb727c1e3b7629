#pragma once

#include <cstdint>
#include <string>

namespace tunnel_pilot::bridge {

/// Safety state, owned by the bridge: INIT -> STANDBY -> ARMED -> ACTIVE <-> DEGRADED -> STOPPING -> STOPPED.
enum class SafetyState : std::uint8_t {
  kInit = 0,
  kStandby = 1,
  kArmed = 2,
  kActive = 3,
  kDegraded = 4,   ///< at most 1.5 m/s, recovers after 1 s of health
  kStopping = 5,   ///< brakes, may steer
  kStopped = 6,    ///< latched: leaves only by an operator's reset
};

std::string toString(SafetyState state);

}  // namespace tunnel_pilot::bridge
