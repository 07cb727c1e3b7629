#pragma once

#include <string>
#include <vector>

#include "tunnel_pilot/simulation/report.h"

namespace tunnel_pilot::simulation {

/// A PNG with its title.
struct Picture {
  std::string title;
  std::string png;
};

/// The report as one page of HTML that is well-formed XML, too, and needs nothing beside it: no script,
/// no file, no address. Goals with their figures and how the episodes spread, pictures, each episode's
/// ending and metrics, and what gives the results again. Figures stand in <data>, whose value is in SI
/// units and radians.
std::string htmlReport(const Scenario& scenario, const Evaluation& evaluation,
                       const std::vector<EpisodeResult>& episodes, const Fingerprints& fingerprints,
                       const std::vector<Picture>& pictures);

}  // namespace tunnel_pilot::simulation
