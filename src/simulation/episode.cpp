#include "tunnel_pilot/simulation/episode.h"

#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <type_traits>

#include "experiments.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"
#include "tunnel_pilot/vehicle/truck_variation.h"

namespace tunnel_pilot::simulation {
namespace {

// The world an experiment drives in; empty for those without.
std::string worldOf(const Experiment& experiment) {
  if (const auto* drive = std::get_if<DriveExperiment>(&experiment)) return drive->world_file;
  if (const auto* perception = std::get_if<PerceptionExperiment>(&experiment))
    return perception->world_file;
  return "";
}

bool bothDirections(const Experiment& experiment) {
  if (const auto* drive = std::get_if<DriveExperiment>(&experiment)) return drive->both_directions;
  if (const auto* perception = std::get_if<PerceptionExperiment>(&experiment)) {
    return perception->both_directions;
  }
  return false;
}

EpisodeResult runExperiment(const Scenario& scenario, const Setup& setup, const EpisodePlan& plan,
                            DriveObserver* observer) {
  return std::visit(
      [&](const auto& experiment) {
        using Kind = std::decay_t<decltype(experiment)>;
        if constexpr (std::is_same_v<Kind, DriveExperiment>) {
          return runDrive(experiment, scenario, setup, plan, observer);
        } else if constexpr (std::is_same_v<Kind, SteadyTurnExperiment>) {
          return runSteadyTurn(experiment, scenario, setup, plan.seed);
        } else if constexpr (std::is_same_v<Kind, LaneChangeExperiment>) {
          return runLaneChange(experiment, scenario, setup, plan, observer);
        } else {
          return runPerception(experiment, setup, plan.seed, plan.reversed);
        }
      },
      scenario.experiment);
}

}  // namespace

std::unique_ptr<vehicle::Plant> makePlant(const PlantChoice& choice,
                                          const vehicle::TruckParameters& truck, std::uint64_t seed) {
  const vehicle::TruckParameters parameters =
      vehicle::varied(truck, streamSeed(seed, Stream::kPlantVariation), choice.variation);
  if (choice.model == PlantModel::kKinematic)
    return std::make_unique<vehicle::KinematicTruck>(parameters);
  vehicle::DynamicTruckOptions options;
  options.load = choice.load;
  options.rough_road = choice.rough_road;
  options.road_seed = streamSeed(seed, Stream::kRoad);
  return std::make_unique<vehicle::DynamicTruck>(parameters, options);
}

TrackSample sampleOf(const vehicle::PlantState& state, const vehicle::TruckGeometry& truck) {
  TrackSample sample;
  sample.front = state.pose;
  sample.rear = vehicle::rearPose(truck, state.pose, state.articulation);
  sample.articulation = state.articulation;
  sample.speed = state.speed;
  sample.yaw_rate = state.yaw_rate;
  sample.lateral_acceleration = state.lateral_acceleration;
  return sample;
}

Setup loadSetup(const Scenario& scenario) {
  const std::string folder = scenario.config_folder + "/";
  Setup setup{vehicle::loadTruck(folder + "truck.yaml"),
              loadSimulator(config::loadFile(folder + "simulator.yaml")),
              loadTruckController(config::loadFile(folder + "truck_controller.yaml")),
              loadPilot(scenario.config_folder, scenario.preview_law),
              {}};
  can::Profile& pilots = setup.pilot.bridge.can;
  if (scenario.profile) pilots.kind = setup.truck_controller.can.kind = *scenario.profile;
  can::requireAgreement(pilots, setup.truck_controller.can);
  setup.fingerprints.scenario = sha256OfFiles({scenario.file});
  std::vector<std::string> controller = pilotFiles(scenario.config_folder);
  const drivers::PreviewDriverParameters& preview = setup.pilot.preview_driver;
  if (preview.law == drivers::PreviewLaw::kNetwork) controller.push_back(preview.network_law.file);
  setup.fingerprints.controller = sha256OfFiles(controller);
  setup.fingerprints.plant = sha256OfFiles(
      {folder + "truck.yaml", folder + "simulator.yaml", folder + "truck_controller.yaml"});
  const std::string world = worldOf(scenario.experiment);
  if (!world.empty()) setup.fingerprints.world = sha256OfFiles({world});
  return setup;
}

void chooseDriver(const Scenario& scenario, DriverChoice driver, const std::string& network,
                  Setup& setup) {
  setup.pilot.driver = driver;
  setup.fingerprints.driver = toString(driver);
  if (driver == DriverChoice::kPreviewDriver) return;
  if (std::holds_alternative<LaneChangeExperiment>(scenario.experiment)) {
    throw config::ConfigError(scenario.file + ": the path of a lane change is sensed without a scan, " +
                              "lidar_driver cannot drive it");
  }
  const std::string file = network.empty() ? setup.pilot.lidar_driver.network : network;
  setup.pilot.network = std::make_shared<neural::NetworkFile>(neural::loadNetwork(file));
  // Whether it is a lidar driver's is told before the runs.
  drivers::LidarDriver(setup.pilot.lidar_driver, setup.truck.geometry, *setup.pilot.network);
  setup.fingerprints.network = setup.pilot.network->sha256;
}

std::vector<EpisodePlan> episodePlans(const Scenario& scenario, int seeds) {
  std::vector<EpisodePlan> plans;
  for (int i = 0; i < seeds; ++i) {
    const std::uint64_t seed = scenario.first_seed + static_cast<std::uint64_t>(i);
    plans.push_back({seed, false});
    if (bothDirections(scenario.experiment)) plans.push_back({seed, true});
  }
  return plans;
}

EpisodeResult runEpisode(const Scenario& scenario, const Setup& setup, const EpisodePlan& plan,
                         DriveObserver* observer) {
  EpisodeResult result = runExperiment(scenario, setup, plan, observer);
  result.seed = plan.seed;
  result.reversed = plan.reversed;
  return result;
}

std::vector<EpisodeResult> runEpisodes(const Scenario& scenario, const Setup& setup,
                                       const std::vector<EpisodePlan>& plans, int jobs,
                                       const std::function<void(std::size_t)>& progress) {
  std::vector<EpisodeResult> results(plans.size());
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::size_t done = 0;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t i = next++; i < plans.size(); i = next++) {
      try {
        results[i] = runEpisode(scenario, setup, plans[i]);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (!failure) failure = std::current_exception();
        next = plans.size();
        return;
      }
      const std::lock_guard<std::mutex> lock(mutex);
      progress(++done);
    }
  };
  std::vector<std::thread> threads;
  for (int i = 1; i < jobs; ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
  return results;
}

}  // namespace tunnel_pilot::simulation
