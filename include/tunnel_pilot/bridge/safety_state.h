#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/supervision/command.h"

namespace tunnel_pilot::bridge {

/// Safety state, owned by the bridge: INIT -> STANDBY -> ARMED -> ACTIVE <-> DEGRADED -> STOPPING ->
/// STOPPED.
enum class SafetyState : std::uint8_t {
  kInit = 0,     ///< no healthy frames from the truck yet
  kStandby = 1,  ///< healthy, not engaged
  kArmed = 2,    ///< engaged; frames "not intended to steer" until the first command to drive
  kActive = 3,
  kDegraded = 4,  ///< at most 1.5 m/s, recovers after 1 s of health
  kStopping = 5,  ///< brakes, may steer
  kStopped = 6,   ///< latched: leaves only by an operator's reset
};

std::string toString(SafetyState state);

/// The pilot drives, or is about to: what the arbiter calls engaged.
constexpr bool isEngaged(SafetyState state) {
  return state == SafetyState::kArmed || state == SafetyState::kActive ||
         state == SafetyState::kDegraded;
}
constexpr bool isStop(SafetyState state) {
  return state == SafetyState::kStopping || state == SafetyState::kStopped;
}

/// What may happen to the bridge.
enum class Event : std::uint8_t {
  kLinkHealthy,      ///< frames from the truck fresh and right for 1 s
  kEngage,           ///< operator, accepted only with all inputs healthy for 1 s
  kCommandReady,     ///< armed long enough, and a fresh command wants to drive
  kArmingTimedOut,   ///< no such command came
  kDegradeAsked,     ///< the command says why the drive is less than healthy
  kMeasurementLate,  ///< the command's measurement is getting old
  kRecovered,        ///< 1 s without the two above
  kBusFault,         ///< bus-off, down, or nothing can be sent
  kForeignSender,    ///< someone else uses our identifiers
  kFeedbackCorrupt,  ///< three of ten frames wrong
  kFeedbackStale,
  kOperatorOverride,
  kKeyTurned,  ///< the operator's key left autonomous
  kTruckFault,
  kTruckRefuses,  ///< the truck's controller does not obey though it is asked to
  kTrackingError,
  kProcessSilent,  ///< no heartbeat of one of the pilot's processes
  kCommandStale,
  kMeasurementStale,
  kCommandStop,  ///< the arbiter asks for a stop
  kOperatorStop,
  kOperatorRelease,
  kClockJump,
  kStandstill,     ///< stopped, or the stop took longer than any stop can
  kOperatorReset,  ///< accepted only with all inputs healthy for 1 s
};
constexpr int kEventCount = static_cast<int>(Event::kOperatorReset) + 1;

std::string toString(Event event);

/// One row of the table: in any of the states `from`, `event` leads to `to` for `reason`. No reason in
/// the row: the one that the arbiter's command carries; STOPPED keeps the reason of its STOPPING.
struct Transition {
  std::vector<SafetyState> from;
  Event event;
  SafetyState to;
  std::optional<supervision::Reason> reason;
};

/// The whole state machine (drawn in docs/can.md from here). What is not in it changes nothing.
const std::vector<Transition>& transitionTable();

/// The row that applies, or nullptr.
const Transition* findTransition(SafetyState state, Event event);

}  // namespace tunnel_pilot::bridge
