#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <vector>

#include "tunnel_pilot/simulation/pilot.h"
#include "tunnel_pilot/simulation/report.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/simulation/simulator.h"

namespace tunnel_pilot::simulation {

/// The parameters of all rooms, read once per scenario from its config folder.
struct Setup {
  vehicle::TruckParameters truck;
  SimulatorParameters simulator;
  TruckControllerParameters truck_controller;
  PilotParameters pilot;
  Fingerprints fingerprints;
};

/// Throws config::ConfigError.
Setup loadSetup(const Scenario& scenario);

/// Lets these drivers propose. The lidar driver's network is read from the file `network`, or from the
/// one that config/lidar_driver.yaml names when it is empty. Throws config::ConfigError, also for a
/// scenario in which no scan is driven on.
void chooseDriver(const Scenario& scenario, DriverChoice driver, const std::string& network,
                  Setup& setup);

/// The plant that a seed drives: with its own parameters where the scenario varies them, and its own
/// road.
std::unique_ptr<vehicle::Plant> makePlant(const PlantChoice& choice,
                                          const vehicle::TruckParameters& truck, std::uint64_t seed);

/// One seed of a scenario, once along its way.
struct EpisodePlan {
  std::uint64_t seed;
  bool reversed;
  std::ostream* can_log = nullptr;  ///< takes the bus's log (docs/can.md); drives and lane changes
};

/// All episodes of a scenario: `seeds` seeds from its first one, each in the directions it asks for.
std::vector<EpisodePlan> episodePlans(const Scenario& scenario, int seeds);

/// Watches a drive from outside while the pilot drives.
class DriveObserver {
 public:
  virtual ~DriveObserver() = default;
  virtual void afterScan(const Simulator& simulator, const Pilot& pilot) = 0;  ///< pilot has answered it
  virtual void afterTruth(const Simulator& simulator) = 0;  ///< truth() is new; drives only
};

/// Runs one episode; drives and lane changes tell their observer. Depends on its arguments alone. Throws
/// config::ConfigError when the scenario's world cannot be read.
EpisodeResult runEpisode(const Scenario& scenario, const Setup& setup, const EpisodePlan& plan,
                         DriveObserver* observer = nullptr);

/// Runs episodes on `jobs` threads and returns them in the order of their plans; `progress` is called
/// with the number done, from one thread at a time. The first exception of an episode is thrown on.
std::vector<EpisodeResult> runEpisodes(const Scenario& scenario, const Setup& setup,
                                       const std::vector<EpisodePlan>& plans, int jobs,
                                       const std::function<void(std::size_t)>& progress);

}  // namespace tunnel_pilot::simulation
