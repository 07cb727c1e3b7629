#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tunnel_pilot/learning/demonstration.h"
#include "tunnel_pilot/learning/human_driver.h"
#include "tunnel_pilot/learning/network_trainer.h"
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

/// Lessons as a data set: labels as he drove, or corrected (then without those that could not be).
DataSet examplesOf(const std::vector<Lesson>& lessons, bool corrected);

/// Human's drives for training.
struct HumanOptions {
  HumanHabit habit;
  std::uint64_t first_seed = 1000;  ///< of the drives, each seed both ways
  int drives = 80;
  int validation_drives = 8;  ///< the seeds behind those
  int keep_every = 2;
  int jobs = 2;
};

struct HumanLessons {
  std::vector<Lesson> training, validation;
  std::vector<simulation::Metrics> metrics;  ///< of every drive
  double inside_mean = 0.0;                  ///< mean over the drives [m]
  double inside_heading = 0.0;               ///< [rad]
};

/// `progress` is told the number of drives done, from one thread at a time.
HumanLessons collectHumanLessons(const simulation::Scenario& scenario, const simulation::Setup& setup,
                                 const HumanOptions& options, const std::function<void(int)>& progress);

/// The human experiment: is an inside cut learned, and does the correction take it out again? Trains two
/// networks of the given kind on the human's drives alone, one with his labels and one with corrected
/// ones, and lets each drive the scenario's first `seeds` seeds (from its first_seed), each both ways
/// where it says so.
struct HumanReport {
  double human_inside = 0.0;                              ///< inside_mean, mean over drives [m]
  double human_heading = 0.0;                             ///< [rad]
  std::vector<simulation::EpisodeResult> raw, corrected;  ///< drives of the networks, without tracks
  double raw_inside = 0.0, corrected_inside = 0.0;        ///< mean over the drives [m]
};

struct HumanNetworks {
  neural::NetworkFile raw, corrected;
};

HumanReport humanExperiment(const simulation::Scenario& scenario, const simulation::Setup& setup,
                            const HumanOptions& options, const TrainingOptions& training, int seeds,
                            HumanNetworks& networks,
                            const std::function<void(const std::string&)>& tell);

}  // namespace tunnel_pilot::learning
