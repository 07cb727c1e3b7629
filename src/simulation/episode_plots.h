#pragma once

#include <string>

#include "tunnel_pilot/simulation/report.h"

namespace tunnel_pilot::simulation {

/// The picture of one episode as a PNG: what happened seen from above, and the errors over the way.
/// Empty for an episode without a track.
std::string episodePicture(const Scenario& scenario, const EpisodeResult& episode,
                           const vehicle::TruckGeometry& truck);

}  // namespace tunnel_pilot::simulation
