#pragma once

#include <cstdint>
#include <string>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::supervision {

/// What is wanted of the truck, as the arbiter lets it out and the bridge sends it.
enum class Mode : std::uint8_t { kStandby = 0, kAutonomous = 1, kShared = 2, kTeleoperation = 3 };

/// Who steers.
enum class Source : std::uint8_t {
  kNone = 0,
  kLidarDriver = 1,
  kPreviewDriver = 2,
  kWireDriver = 3,
  kLaneKeeper = 4,
  kSharedControl = 5,
  kTeleoperation = 6,
  kDeadReckoning = 7,  ///< a stop along the last measured centerline
  kHold = 8,           ///< a stop that holds the articulation
};

/// Why the truck does what it does: one code wins, the gravest first reason found. Numbers are part of
/// the contract (message, CAN, logs) and never reused.
enum class Reason : std::uint8_t {
  kNone = 0,        ///< driving as asked
  kNotEngaged = 1,  ///< nobody engaged the pilot
  kOperatorStop = 2,
  kOperatorRelease = 3,
  kNoSource = 4,  ///< no healthy source of steering
  kSourceStale = 5,
  kProposalInvalid = 6,  ///< non-finite or out of range
  kTunnelInvalid = 7,
  kScanStale = 8,
  kScanRejected = 9,
  kMotionStale = 10,    ///< odometry or articulation feedback too old
  kTrackingError = 11,  ///< articulation does not follow its command
  kClearance = 12,      ///< swept width leaves less than the margin
  kObstacle = 13,       ///< free distance shorter than the stopping distance
  kClockJump = 14,
  kCommandStale = 15,     ///< the bridge got no fresh command
  kFeedbackStale = 16,    ///< the bridge got no fresh frames from the truck
  kFeedbackCorrupt = 17,  ///< CRC or counter of feedback wrong
  kBusFault = 18,
  kTruckFault = 19,  ///< the truck's controller reports a fault
  kOperatorOverride = 20,
  kLimitsHit = 21,  ///< angle or lateral acceleration limited again and again
  kStartUp = 22,
  kScanFrozen = 23,
  kSpeedImplausible = 24,
  kLowConfidence = 25,    ///< a driver is less sure than its rule asks for
  kDriversDisagree = 26,  ///< two drivers ask for different articulations
  kProcessSilent = 27,    ///< a process of the pilot gives no sign of life
};

/// False for a number that is none of these: a message may hold any.
bool isKnown(Mode mode);
bool isKnown(Source source);
bool isKnown(Reason reason);

std::string toString(Mode mode);
std::string toString(Source source);
/// The reason in words an operator understands.
std::string toString(Reason reason);

struct Command {
  Stamp stamp{};                    ///< of the measurement it stems from
  std::uint32_t sequence = 0;       ///< never decreases
  double articulation_angle = 0.0;  ///< [rad]
  double speed = 0.0;               ///< [m/s]
  double acceleration = 0.0;        ///< highest magnitude of speed change wanted [m/s^2]
  bool stop = false;                ///< brake to standstill, steering as given
  Mode mode = Mode::kStandby;
  Source source = Source::kNone;
  Reason reason = Reason::kNone;
};

}  // namespace tunnel_pilot::supervision
