#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/learning/demonstration.h"
#include "tunnel_pilot/learning/human_driver.h"
#include "tunnel_pilot/learning/recipe.h"
#include "tunnel_pilot/simulation/episode.h"

namespace tunnel_pilot::learning {

/// One drive of the simulated human, with what its recording teaches.
struct HumanDrive {
  simulation::Metrics metrics;  ///< true ones, for the report alone
  double inside_heading =
      0.0;  ///< heading error to the inside of bends, mean over them [rad]; true, too
  std::vector<Lesson> lessons;
};

/// Lets the human drive through the scenario's world, with its plant and seed, while the truck's
/// sensors, its lidar and the perception record; `keep_every`th scan is kept. The scenario must be a
/// drive in a world with an open design line. Throws std::invalid_argument otherwise.
HumanDrive driveAsHuman(const simulation::Scenario& scenario, const simulation::Setup& setup,
                        const simulation::EpisodePlan& plan, const HumanHabit& habit, int keep_every);

/// Lessons as a data set: labels as he drove, or corrected ones, without the lessons that could not be.
/// Of the corrected ones those inside of bends are thinned until they are no more than those as far
/// outside (a few stay, which teach to come back): a network that saw bends from inside almost only
/// takes itself to be inside there, even in the middle.
DataSet examplesOf(const std::vector<Lesson>& lessons, bool corrected);

/// The human experiment.
struct HumanOptions {
  HumanHabit habit;
  std::uint64_t first_seed = 1000;  ///< of his tunnels; none that anything is reported on
  int tunnels = 80;                 ///< driven through, each both ways
  int keep_every = 4;               ///< scans
  int evaluated = 20;               ///< seeds that the networks drive, from the scenario's first one
};

/// How far inside of bends somebody drives: metric inside_mean [m], one value a drive that met a bend.
struct InsideReport {
  std::vector<double> inside;
  int drives = 0;
  int completed = 0;    ///< of them
  double mean() const;  ///< [m]
};

struct HumanReport {
  InsideReport human;
  double human_heading = 0.0;  ///< to the inside of bends, mean [rad]
  InsideReport raw, corrected;
  std::optional<neural::NetworkFile> raw_network, corrected_network;  ///< both there
};

/// Is an inside cut learned, and does the correction take it out again? The human drives through tunnels
/// of the scenario's kind; two networks are trained as the recipe says, but on his drives alone, one
/// with his labels and one with corrected ones; each drives the scenario. `scenario` and `setup` as for
/// driveAsHuman. `tell` gets lines for people. The result does not depend on `jobs`.
HumanReport humanExperiment(const simulation::Scenario& scenario, const simulation::Setup& setup,
                            const HumanOptions& options, const Recipe& recipe, int jobs,
                            const std::function<void(const std::string&)>& tell);

}  // namespace tunnel_pilot::learning
