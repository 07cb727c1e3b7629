#pragma once

#include <string>

#include "tunnel_pilot/simulation/report.h"

namespace tunnel_pilot::simulation {

/// Writes the picture of one episode: what happened seen from above, and the errors over the way.
void plotEpisode(const std::string& file, const Scenario& scenario, const EpisodeResult& episode,
                 const vehicle::TruckGeometry& truck);

}  // namespace tunnel_pilot::simulation
