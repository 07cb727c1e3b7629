#pragma once

#include <optional>

#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/perception/types.h"

namespace tunnel_pilot::drivers {

/// The truck's own motion as measured over CAN.
struct Motion {
  Stamp stamp{};
  geometry::Pose pose;             ///< base_link in odom (dead reckoning)
  double speed = 0.0;              ///< [m/s]
  double yaw_rate = 0.0;           ///< front body [rad/s]
  double articulation = 0.0;       ///< [rad]
  double articulation_rate = 0.0;  ///< [rad/s]
};

/// What a driver asks for. Steering and speed are chosen apart by the arbiter.
struct Proposal {
  Stamp stamp{};  ///< of the measurement (scan) it stems from
  bool valid = false;
  double articulation_angle = 0.0;               ///< [rad]
  double speed = 0.0;                            ///< highest speed the driver thinks right [m/s]
  double confidence = 0.0;                       ///< 0..1
  std::optional<geometry::Point> preview_point;  ///< in base_link, for the eyes [m]
};

/// A driver that follows the measured centerline.
class PathDriver {
 public:
  virtual ~PathDriver() = default;

  /// `tunnel` is that of the newest scan, `motion` the newest feedback; both at or before `now`.
  virtual Proposal propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) = 0;
  virtual void reset() = 0;
};

}  // namespace tunnel_pilot::drivers
