#pragma once

#include <algorithm>

#include "tunnel_pilot/drivers/articulation_profile.h"

namespace tunnel_pilot::drivers {

struct PathFollowerGains {
  double offset;   ///< [rad/m]
  double heading;  ///< [rad/rad]
};

/// The simplest law that follows a path: feed-forward by exact curvature inversion plus feedback,
///   gamma = gamma_ref(s) - k_y e_y - k_psi e_psi,   limited to `max_articulation` [rad].
/// It stands in for a driver where none is healthy, and for the one to come in the swept corridor.
inline double followPath(const ArticulationProfile& profile, const PathFollowerGains& gains, double s,
                         double offset, double heading_error, double max_articulation) {
  return std::clamp(profile.at(s) - gains.offset * offset - gains.heading * heading_error,
                    -max_articulation, max_articulation);
}

}  // namespace tunnel_pilot::drivers
