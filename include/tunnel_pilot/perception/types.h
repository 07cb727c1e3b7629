#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::perception {

/// A wall as measured: the returns that belong to it and a curve fitted through them, both in base_link.
struct Wall {
  bool found = false;
  std::vector<int> indices;            ///< of the input cloud's points that lie on it (inliers)
  std::vector<geometry::Point> curve;  ///< fitted curve, near end first, about every 0.5 m [m]
  double residual = 0.0;               ///< RMS distance of the inliers to the curve [m]
};

/// Where both walls were found, their curves pair up: left.curve[i] and right.curve[i] lie across from
/// each other, on one normal of the centerline; one may be longer than the other.
struct Walls {
  Stamp stamp{};
  bool enough_returns = false;  ///< there were points enough to look for walls
  Wall left;
  Wall right;
};

/// Why there is no valid tunnel state.
enum class TunnelReason : std::uint8_t {
  kNone = 0,              ///< valid
  kNoScan = 1,            ///< nothing was measured yet, or the scan was rejected
  kTooFewPoints = 2,      ///< too few usable returns
  kNoWalls = 3,           ///< neither wall found
  kNeverPaired = 4,       ///< one wall found, but both were never seen together
  kSingleTooLong = 5,     ///< one wall followed beyond the allowed distance
  kWidthImplausible = 6,  ///< walls found, but not a tunnel of the configured widths
  kWidthJump = 7,         ///< width changed in a way that was not seen coming
  kPoorFit = 8,           ///< residual or covariance too large
};

/// "no walls found", ... in words, for logs and rviz.
std::string toString(TunnelReason reason);

/// Where the truck is in the tunnel. All of the reference point (base_link).
struct TunnelState {
  Stamp stamp{};  ///< the scan's
  bool valid = false;
  TunnelReason reason = TunnelReason::kNoScan;
  double lateral_offset = 0.0;  ///< left of the centerline [m]
  double heading_error = 0.0;   ///< truck heading minus tunnel direction [rad]
  double curvature = 0.0;       ///< of the centerline beside the reference point [1/m]
  double width = 0.0;           ///< distance between the walls [m]
  /// Row-major covariance of (lateral_offset, heading_error, curvature, width), SI units squared.
  std::array<double, 16> covariance{};
};

/// A tunnel state with the centerline it stems from, in base_link. The path starts beside or behind the
/// reference point and reaches as far as it was measured; empty when the state is not valid.
struct Tunnel {
  TunnelState state;
  geometry::Path centerline;
};

}  // namespace tunnel_pilot::perception
