#include "tunnel_pilot/bridge/safety_state.h"

namespace tunnel_pilot::bridge {

std::string toString(SafetyState state) {
  switch (state) {
    case SafetyState::kInit: return "INIT";
    case SafetyState::kStandby: return "STANDBY";
    case SafetyState::kArmed: return "ARMED";
    case SafetyState::kActive: return "ACTIVE";
    case SafetyState::kDegraded: return "DEGRADED";
    case SafetyState::kStopping: return "STOPPING";
    case SafetyState::kStopped: return "STOPPED";
  }
  return "unknown state";
}

}  // namespace tunnel_pilot::bridge
