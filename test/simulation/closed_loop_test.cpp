// The pilot, the bus and the simulated truck together.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"

namespace tunnel_pilot::simulation {
namespace {

using bridge::SafetyState;
using supervision::Reason;

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;
constexpr std::uint64_t kSeed = 1000;

Scenario straightDrive() {
  Scenario scenario = loadScenario(kPackage + "/scenarios/return_towards.yaml");
  DriveExperiment& drive = std::get<DriveExperiment>(scenario.experiment);
  drive.station = 20.0;
  drive.lateral_offset = 0.0;
  drive.heading_error = 0.0;
  drive.rolling_speed = 0.0;
  drive.distance = 30.0;
  drive.return_metrics = false;
  return scenario;
}

// The loaded dynamic truck in the default drift, driven by the pilot for as long as a test wants.
class Drift : public ::testing::Test {
 protected:
  Drift()
      : truck_(vehicle::loadTruck(kPackage + "/config/truck.yaml")),
        truck_side_(hub_.connect()),
        pilot_side_(hub_.connect()),
        simulator_(loadSimulator(config::loadFile(kPackage + "/config/simulator.yaml")),
                   loadTruckController(config::loadFile(kPackage + "/config/truck_controller.yaml")),
                   truck_,
                   std::make_unique<vehicle::DynamicTruck>(truck_, vehicle::DynamicTruckOptions{}),
                   vehicle::Load::kLoaded, world::loadWorld(kPackage + "/worlds/default_drift.yaml"),
                   kSeed, *truck_side_),
        pilot_(loadPilot(kPackage + "/config"), truck_, *pilot_side_) {}

  void run(double seconds) {
    const Stamp end = simulator_.now() + fromSeconds(seconds);
    while (simulator_.now() < end) {
      const Simulator::Events& events = simulator_.step();
      if (events.scan != nullptr) pilot_.takeScan(*events.scan, simulator_.now());
      if (simulator_.now() >= next_tick_) {
        pilot_.tick(simulator_.now());
        next_tick_ += fromSeconds(1.0 / Pilot::kTickRate);
      }
    }
  }

  // Engages and drives up to speed.
  void drive(double seconds) {
    run(2.0);
    ASSERT_TRUE(pilot_.engage(simulator_.now()).accepted);
    run(seconds);
    ASSERT_GT(simulator_.state().speed, 2.0);
  }

  SafetyState safety() const { return pilot_.bridge().status().state; }
  Reason reason() const { return pilot_.bridge().status().reason; }

  vehicle::TruckParameters truck_;
  can::MemoryBusHub hub_;
  std::unique_ptr<can::Bus> truck_side_, pilot_side_;
  Simulator simulator_;
  Pilot pilot_;
  Stamp next_tick_{};
};

TEST_F(Drift, NothingMovesBeforeSomebodyEngages) {
  run(5.0);
  EXPECT_LT(std::abs(simulator_.truth().station - 14.0), 0.05);
  EXPECT_EQ(safety(), SafetyState::kStandby);
}

TEST_F(Drift, EngagingIsRefusedBeforeASecondOfHealth) {
  run(0.5);
  EXPECT_FALSE(pilot_.engage(simulator_.now()).accepted);
}

TEST_F(Drift, DrivesAlongTheMiddle) {
  drive(15.0);
  EXPECT_EQ(safety(), SafetyState::kActive);
  EXPECT_NEAR(simulator_.state().speed, 3.0, 0.2);
  EXPECT_LT(std::abs(simulator_.truth().lateral_offset), 0.2);
}

TEST_F(Drift, ADeadLidarStopsTheTruckInItsTrackAndItStaysStopped) {
  drive(12.0);
  const double station = simulator_.truth().station;
  simulator_.setLidarAlive(false);
  run(0.5);
  EXPECT_EQ(safety(), SafetyState::kStopping);
  run(5.0);
  EXPECT_EQ(safety(), SafetyState::kStopped);
  EXPECT_LT(std::abs(simulator_.state().speed), 0.05);
  EXPECT_LT(simulator_.truth().station - station, 6.0) << "within the stopping distance";
  EXPECT_LT(std::abs(simulator_.truth().lateral_offset), 0.35);
  simulator_.setLidarAlive(true);
  run(5.0);
  EXPECT_EQ(safety(), SafetyState::kStopped) << "never resumes by itself";
  EXPECT_LT(std::abs(simulator_.state().speed), 0.05);
  EXPECT_EQ(simulator_.truth().contacts, 0u);
}

TEST_F(Drift, ADeadBusStopsTheTruckByItsOwnController) {
  drive(12.0);
  hub_.setState(can::BusState::kDown);
  run(5.0);
  EXPECT_LT(std::abs(simulator_.state().speed), 0.05);
  EXPECT_NE(safety(), SafetyState::kActive);
  EXPECT_EQ(simulator_.truth().contacts, 0u);
}

TEST_F(Drift, AnOperatorsBrakePedalTakesOver) {
  drive(12.0);
  OperatorInputs inputs;
  inputs.brake = 0.6;
  simulator_.controller().setOperator(inputs);
  run(0.3);
  EXPECT_NE(safety(), SafetyState::kActive);
  run(5.0);
  EXPECT_LT(std::abs(simulator_.state().speed), 0.05);
  simulator_.controller().setOperator({});
  run(3.0);
  EXPECT_LT(std::abs(simulator_.state().speed), 0.05) << "no return by itself";
}

TEST(Episode, DrivesItsWayAndTellsItsFigures) {
  const Scenario scenario = straightDrive();
  const EpisodeResult result = runEpisode(scenario, loadSetup(scenario), {kSeed, false});
  EXPECT_EQ(result.ending, "way driven");
  EXPECT_DOUBLE_EQ(result.metrics.at("completed"), 1.0);
  EXPECT_NEAR(result.metrics.at("distance"), 30.0, 0.2);
  EXPECT_LT(result.metrics.at("lateral_max"), 0.25);
  EXPECT_GT(result.metrics.at("clearance_min"), 2.0);
  EXPECT_FALSE(result.perception.empty());
  EXPECT_EQ(result.metrics.at("stops"), 0.0);
  // From standstill over 30 m to 2 m/s: 2.5 s and 13.75 s, and the truck's own delays.
  EXPECT_NEAR(result.metrics.at("lap_efficiency") * result.metrics.at("lap_time"), 16.25, 0.05);
  EXPECT_GT(result.metrics.at("lap_efficiency"), 0.85);
  EXPECT_LE(result.metrics.at("lap_efficiency"), 1.0);
}

TEST(Episode, DrivesItsWayOverJ1939AndPutsNothingElseOnTheBus) {
  Scenario scenario = straightDrive();
  scenario.profile = can::ProfileKind::kJ1939;
  std::ostringstream log;
  EpisodePlan plan{kSeed, false};
  plan.can_log = &log;
  const EpisodeResult result = runEpisode(scenario, loadSetup(scenario), plan);
  EXPECT_EQ(result.ending, "way driven");
  EXPECT_NE(log.str().find(" 18EEFF80#"), std::string::npos) << "the pilot's claim";
  EXPECT_NE(log.str().find(" 0CFF1080#"), std::string::npos);
  EXPECT_NE(log.str().find(" 0CFF2081#"), std::string::npos);
  EXPECT_EQ(log.str().find(" 110#"), std::string::npos);
  EXPECT_EQ(log.str().find(" 120#"), std::string::npos);
}

TEST(Episode, DependsOnItsSeedAlone) {
  const Scenario scenario = straightDrive();
  const simulation::Setup setup = loadSetup(scenario);
  const auto results =
      runEpisodes(scenario, setup, {{kSeed, false}, {kSeed + 1, false}}, 1, [](auto) {});
  const auto threaded =
      runEpisodes(scenario, setup, {{kSeed, false}, {kSeed + 1, false}}, 2, [](auto) {});
  for (std::size_t i = 0; i < results.size(); ++i) {
    EXPECT_EQ(results[i].metrics, threaded[i].metrics);
    ASSERT_EQ(results[i].track.size(), threaded[i].track.size());
    EXPECT_EQ(results[i].track.back().front.x, threaded[i].track.back().front.x);
  }
  EXPECT_NE(results[0].metrics, results[1].metrics);
}

TEST(Episode, ATruckThatMayNotDriveRunsOutOfTime) {
  Scenario scenario = straightDrive();
  std::get<DriveExperiment>(scenario.experiment).time_limit = 3.0;
  const EpisodeResult result = runEpisode(scenario, loadSetup(scenario), {kSeed, false});
  EXPECT_EQ(result.ending, "time over");
  EXPECT_DOUBLE_EQ(result.metrics.at("completed"), 0.0);
  EXPECT_EQ(result.metrics.count("lap_time"), 0u);
}

TEST(Episode, ARollingStartHandsOverAtTheStartPose) {
  const Scenario scenario = loadScenario(kPackage + "/scenarios/return_away.yaml");
  const DriveExperiment& drive = std::get<DriveExperiment>(scenario.experiment);
  const EpisodeResult result = runEpisode(scenario, loadSetup(scenario), {kSeed, false});
  const TrackSample& first = result.track.front();
  EXPECT_NEAR(first.station, drive.station, 0.15);
  EXPECT_NEAR(first.lateral_offset, drive.lateral_offset, 0.05);
  EXPECT_NEAR(first.heading_error, drive.heading_error, 0.01);
  EXPECT_NEAR(first.articulation, 0.0, 0.005);
  EXPECT_NEAR(first.speed, drive.rolling_speed, 0.1);
}

TEST(Episode, AWorldThatIsNotThereIsTold) {
  Scenario scenario = straightDrive();
  const simulation::Setup setup = loadSetup(scenario);
  std::get<DriveExperiment>(scenario.experiment).world_file = "nowhere.yaml";
  EXPECT_THROW(runEpisodes(scenario, setup, {{1, false}, {2, false}}, 2, [](auto) {}),
               config::ConfigError);
}

TEST(EpisodePlans, HoldEverySeedInEveryDirection) {
  const Scenario both = loadScenario(kPackage + "/scenarios/unseen_drifts.yaml");
  const auto plans = episodePlans(both, 20);
  ASSERT_EQ(plans.size(), 40u);
  EXPECT_EQ(plans.front().seed, 1u);
  EXPECT_EQ(plans.back().seed, 20u);
  EXPECT_NE(plans[0].reversed, plans[1].reversed);
  EXPECT_EQ(episodePlans(straightDrive(), 3).size(), 3u);
}

TEST(Scenarios, AllShippedOnesLoadWithTheirParameters) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kPackage + "/scenarios")) {
    EXPECT_NO_THROW(loadSetup(loadScenario(entry.path().string()))) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 10);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
