#pragma once

#include <cstdint>
#include <vector>

#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/simulation/metrics.h"
#include "tunnel_pilot/simulation/scenario.h"

namespace tunnel_pilot::simulation {

/// A return to the middle of a straight by the best steering that was found.
struct FastestReturn {
  double settle_time = 0.0;        ///< within the paper's 0.1 m for good after [s]
  double heading_zero_time = 0.0;  ///< [s]
  double overshoot = 0.0;          ///< [m]
  std::vector<double> arcs;        ///< how long the demand turns each way, first away from the start [s]
};

/// How soon the truck that `seed` drives could be back in the middle from heading away, whoever steers.
/// Who steers here knows the truck and where it is, waits for no scan and no frame, and has nothing
/// between him and the plant but the plant (dead time, dead band, flow, lag, bodies, tyres) and the
/// fastest rate that the pilot may demand. The demand turns at that rate, or at the truck's own where
/// that is slower, to the one side and the other by four turns: for a plant that is near to a chain of
/// integrators the fastest steering is bang-bang (Pontryagin's maximum principle). What comes then only
/// holds the truck there. The turns' durations are searched for with Nelder & Mead's simplex from
/// several starts, the overshoot bounded by `most_overshoot` [m], the speed held at the scenario's. What
/// is found can be driven; that nothing is faster shows only as far as several starts come to the same.
FastestReturn fastestReturn(const DriveExperiment& drive, const PlantChoice& plant, const Setup& setup,
                            std::uint64_t seed, double most_overshoot);

}  // namespace tunnel_pilot::simulation
