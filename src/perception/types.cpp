#include "tunnel_pilot/perception/types.h"

namespace tunnel_pilot::perception {

std::string toString(TunnelReason reason) {
  switch (reason) {
    case TunnelReason::kNone:
      return "valid";
    case TunnelReason::kNoScan:
      return "no usable scan";
    case TunnelReason::kTooFewPoints:
      return "too few points";
    case TunnelReason::kNoWalls:
      return "no walls found";
    case TunnelReason::kNeverPaired:
      return "one wall only, never seen with the other";
    case TunnelReason::kSingleTooLong:
      return "one wall followed too far";
    case TunnelReason::kWidthImplausible:
      return "width is no tunnel's";
    case TunnelReason::kWidthJump:
      return "width jumped";
    case TunnelReason::kPoorFit:
      return "walls fit poorly";
  }
  return "unknown reason";
}

}  // namespace tunnel_pilot::perception
