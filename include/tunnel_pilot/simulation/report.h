#pragma once

#include <string>
#include <vector>

#include "tunnel_pilot/simulation/fingerprint.h"
#include "tunnel_pilot/simulation/metrics.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::simulation {

/// All that one seed of a scenario gave.
struct EpisodeResult {
  std::uint64_t seed = 0;
  bool reversed = false;
  std::string ending;  ///< in words: "one lap", "contact", ...
  Metrics metrics;
  std::vector<TrackSample> track;
  std::vector<PerceptionSample> perception;
  geometry::Path line;                  ///< reference of the offsets
  std::vector<world::WallChain> walls;  ///< for the plot

  std::string label() const;  ///< "seed 3", "seed 3 reversed"
};

struct GoalResult {
  Goal goal;
  double median = 0.0;
  double worst = 0.0;  ///< of the episodes, by the goal's bounds
  std::string worst_episode;
  bool holds = false;
};

struct Evaluation {
  std::vector<GoalResult> goals;
  bool passed = false;  ///< every goal holds
};

/// Holds the episodes against the scenario's goals. A metric that an episode does not have fails its
/// goal.
Evaluation judge(const Scenario& scenario, const std::vector<EpisodeResult>& episodes);

/// Console table: metric, paper, goal, median, worst, verdict.
std::string table(const Scenario& scenario, const Evaluation& evaluation);

/// Makes the folder that a report shall go to. Throws std::runtime_error when nothing can be written
/// there.
void makeReportFolder(const std::string& folder);

/// Writes summary.json, report.html (the same for people, one page that needs nothing beside it),
/// episodes.csv, one CSV per episode, and plots of the median and the worst episode (by the first goal)
/// into `folder`, which is made when missing. The same results give the same bytes.
/// Throws std::runtime_error when a file cannot be written.
void writeReport(const std::string& folder, const Scenario& scenario, const Evaluation& evaluation,
                 const std::vector<EpisodeResult>& episodes, const Fingerprints& fingerprints,
                 const vehicle::TruckGeometry& truck);

}  // namespace tunnel_pilot::simulation
