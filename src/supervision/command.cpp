#include "tunnel_pilot/supervision/command.h"

namespace tunnel_pilot::supervision {

bool isKnown(Mode mode) { return mode <= Mode::kTeleoperation; }
bool isKnown(Source source) { return source <= Source::kHold; }
bool isKnown(Reason reason) { return reason <= Reason::kProcessSilent; }

std::string toString(Mode mode) {
  switch (mode) {
    case Mode::kStandby:
      return "standby";
    case Mode::kAutonomous:
      return "autonomous";
    case Mode::kShared:
      return "shared";
    case Mode::kTeleoperation:
      return "teleoperation";
  }
  return "unknown mode";
}

std::string toString(Source source) {
  switch (source) {
    case Source::kNone:
      return "none";
    case Source::kLidarDriver:
      return "lidar_driver";
    case Source::kPreviewDriver:
      return "preview_driver";
    case Source::kWireDriver:
      return "wire_driver";
    case Source::kLaneKeeper:
      return "lane_keeper";
    case Source::kSharedControl:
      return "shared_control";
    case Source::kTeleoperation:
      return "teleoperation";
    case Source::kDeadReckoning:
      return "dead_reckoning";
    case Source::kHold:
      return "hold";
  }
  return "unknown source";
}

std::string toString(Reason reason) {
  switch (reason) {
    case Reason::kNone:
      return "driving as asked";
    case Reason::kNotEngaged:
      return "not engaged";
    case Reason::kOperatorStop:
      return "stopped by the operator";
    case Reason::kOperatorRelease:
      return "released by the operator";
    case Reason::kNoSource:
      return "no healthy driver";
    case Reason::kSourceStale:
      return "the driver's proposal is too old";
    case Reason::kProposalInvalid:
      return "the driver's proposal is not a possible command";
    case Reason::kTunnelInvalid:
      return "no valid tunnel";
    case Reason::kScanStale:
      return "no lidar scan";
    case Reason::kScanRejected:
      return "lidar scans are rejected";
    case Reason::kMotionStale:
      return "no motion feedback";
    case Reason::kTrackingError:
      return "the steering does not follow its command";
    case Reason::kClearance:
      return "too little clearance to a wall";
    case Reason::kObstacle:
      return "obstacle within the stopping distance";
    case Reason::kClockJump:
      return "the clock jumped";
    case Reason::kCommandStale:
      return "no fresh command";
    case Reason::kFeedbackStale:
      return "no fresh frames from the truck";
    case Reason::kFeedbackCorrupt:
      return "frames from the truck are corrupt";
    case Reason::kBusFault:
      return "CAN bus fault";
    case Reason::kTruckFault:
      return "the truck reports a fault";
    case Reason::kOperatorOverride:
      return "the operator took over";
    case Reason::kLimitsHit:
      return "limits hit again and again";
    case Reason::kStartUp:
      return "starting up";
    case Reason::kScanFrozen:
      return "the lidar repeats the same scan";
    case Reason::kSpeedImplausible:
      return "implausible speed";
    case Reason::kLowConfidence:
      return "low confidence of the driver";
    case Reason::kProcessSilent:
      return "a process of the pilot is silent";
    case Reason::kDriversDisagree:
      return "the drivers disagree";
  }
  return "unknown reason";
}

}  // namespace tunnel_pilot::supervision
