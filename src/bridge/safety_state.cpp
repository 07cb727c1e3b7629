#include "tunnel_pilot/bridge/safety_state.h"

#include <algorithm>
#include <array>

namespace tunnel_pilot::bridge {

using supervision::Reason;
using S = SafetyState;
using E = Event;

std::string toString(SafetyState state) {
  switch (state) {
    case SafetyState::kInit:
      return "INIT";
    case SafetyState::kStandby:
      return "STANDBY";
    case SafetyState::kArmed:
      return "ARMED";
    case SafetyState::kActive:
      return "ACTIVE";
    case SafetyState::kDegraded:
      return "DEGRADED";
    case SafetyState::kStopping:
      return "STOPPING";
    case SafetyState::kStopped:
      return "STOPPED";
  }
  return "unknown state";
}

std::string toString(Event event) {
  static const std::array<const char*, kEventCount> names = {
      "link healthy",   "engage",           "command ready",     "arming timed out",
      "degrade asked",  "measurement late", "recovered",         "bus fault",
      "foreign sender", "feedback corrupt", "feedback stale",    "operator override",
      "key turned",     "truck fault",      "truck refuses",     "tracking error",
      "process silent", "command stale",    "measurement stale", "command stop",
      "operator stop",  "operator release", "clock jump",        "standstill",
      "operator reset"};
  const auto index = static_cast<std::size_t>(event);
  return index < names.size() ? names[index] : "unknown event";
}

const std::vector<Transition>& transitionTable() {
  static const std::vector<S> driving = {S::kActive, S::kDegraded};
  static const std::vector<S> idle = {S::kStandby, S::kArmed};
  static const std::vector<S> armed = {S::kArmed};
  static const std::vector<S> all_but_stop = {S::kInit, S::kStandby, S::kArmed, S::kActive,
                                              S::kDegraded};
  static const std::vector<Transition> table = {
      // the way up: each step needs an operator's edge or proven health
      {{S::kInit}, E::kLinkHealthy, S::kStandby, Reason::kNotEngaged},
      {{S::kStandby}, E::kEngage, S::kArmed, Reason::kStartUp},
      {armed, E::kCommandReady, S::kActive, Reason::kNone},
      {armed, E::kArmingTimedOut, S::kStandby, std::nullopt},
      // health while driving
      {driving, E::kDegradeAsked, S::kDegraded, std::nullopt},
      {driving, E::kMeasurementLate, S::kDegraded, Reason::kSourceStale},
      {{S::kDegraded}, E::kRecovered, S::kActive, Reason::kNone},
      // faults while driving: stop, latched
      {driving, E::kBusFault, S::kStopping, Reason::kBusFault},
      {driving, E::kFeedbackCorrupt, S::kStopping, Reason::kFeedbackCorrupt},
      {driving, E::kFeedbackStale, S::kStopping, Reason::kFeedbackStale},
      {driving, E::kOperatorOverride, S::kStopping, Reason::kOperatorOverride},
      {driving, E::kKeyTurned, S::kStopping, Reason::kOperatorRelease},
      {driving, E::kTruckFault, S::kStopping, Reason::kTruckFault},
      {driving, E::kTruckRefuses, S::kStopping, Reason::kTruckFault},
      {driving, E::kTrackingError, S::kStopping, Reason::kTrackingError},
      {driving, E::kProcessSilent, S::kStopping, Reason::kProcessSilent},
      {driving, E::kCommandStale, S::kStopping, Reason::kCommandStale},
      {driving, E::kMeasurementStale, S::kStopping, Reason::kSourceStale},
      {driving, E::kCommandStop, S::kStopping, std::nullopt},
      {driving, E::kOperatorRelease, S::kStopping, Reason::kOperatorRelease},
      {driving, E::kClockJump, S::kStopping, Reason::kClockJump},
      // faults before driving: back to where health must be proven again
      {idle, E::kBusFault, S::kInit, Reason::kBusFault},
      {idle, E::kFeedbackCorrupt, S::kInit, Reason::kFeedbackCorrupt},
      {idle, E::kFeedbackStale, S::kInit, Reason::kFeedbackStale},
      {idle, E::kClockJump, S::kInit, Reason::kClockJump},
      {armed, E::kOperatorOverride, S::kStandby, Reason::kOperatorOverride},
      {armed, E::kKeyTurned, S::kStandby, Reason::kOperatorRelease},
      {armed, E::kTruckFault, S::kStandby, Reason::kTruckFault},
      {armed, E::kProcessSilent, S::kStandby, Reason::kProcessSilent},
      {armed, E::kCommandStale, S::kStandby, Reason::kCommandStale},
      {armed, E::kMeasurementStale, S::kStandby, Reason::kSourceStale},
      {armed, E::kOperatorRelease, S::kStandby, Reason::kOperatorRelease},
      // what stops in every state
      {all_but_stop, E::kForeignSender, S::kStopping, Reason::kBusFault},
      {all_but_stop, E::kOperatorStop, S::kStopping, Reason::kOperatorStop},
      // the way out of a stop
      {{S::kStopping}, E::kStandstill, S::kStopped, std::nullopt},
      {{S::kStopped}, E::kOperatorReset, S::kStandby, Reason::kNotEngaged},
  };
  return table;
}

const Transition* findTransition(SafetyState state, Event event) {
  for (const Transition& row : transitionTable()) {
    if (row.event != event) continue;
    if (std::find(row.from.begin(), row.from.end(), state) != row.from.end()) return &row;
  }
  return nullptr;
}

}  // namespace tunnel_pilot::bridge
