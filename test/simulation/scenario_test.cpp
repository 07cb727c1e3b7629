#include "tunnel_pilot/simulation/scenario.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

namespace tunnel_pilot::simulation {
namespace {

const std::string kGood = R"(
name: probe
title: A probe
config: config
first_seed: 1
seeds: 3
plant: {model: dynamic, load: loaded, rough_road: true, variation: 0.2}
experiment:
  kind: lane_change
  speed: 4.1667
  offset: 10.0
  change_length: 24.0
  straights: [30.0, 30.0]
  offset_sigma: 0.02
  heading_sigma: 0.0035
goals:
  - {metric: path_error_max, paper: overlay plot, judge: every_seed, max: 0.1}
  - {metric: articulation_max, paper: "-", judge: report_only}
)";

// A folder with the scenario file `probe.yaml` and an empty config folder beside it.
class ScenarioFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("scenario_test_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_ / "config");
    std::ofstream(folder_ / "world.yaml") << "type: tunnel\n";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file() const { return (folder_ / "probe.yaml").string(); }
  void write(const std::string& text) const { std::ofstream(file()) << text; }
  Scenario load(const std::string& text) const {
    write(text);
    return loadScenario(file());
  }
  std::string refusal(const std::string& text) const {
    try {
      load(text);
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  }

  std::filesystem::path folder_;
};

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

TEST_F(ScenarioFile, IsReadAsItStands) {
  const Scenario scenario = load(kGood);
  EXPECT_EQ(scenario.name, "probe");
  EXPECT_EQ(scenario.seeds, 3);
  EXPECT_EQ(scenario.plant.model, PlantModel::kDynamic);
  EXPECT_DOUBLE_EQ(scenario.plant.variation, 0.2);
  const auto& change = std::get<LaneChangeExperiment>(scenario.experiment);
  EXPECT_DOUBLE_EQ(change.offset, 10.0);
  ASSERT_EQ(scenario.goals.size(), 2u);
  EXPECT_EQ(scenario.goals[0].judge, Judge::kEverySeed);
  EXPECT_FALSE(scenario.goals[1].max.has_value());
  EXPECT_EQ(scenario.config_folder, (folder_ / "config").string());
  EXPECT_FALSE(scenario.profile.has_value());
}

TEST_F(ScenarioFile, MayChooseTheProfileOfTheBus) {
  EXPECT_EQ(load("profile: j1939" + kGood).profile, can::ProfileKind::kJ1939);
  EXPECT_EQ(load("profile: plain" + kGood).profile, can::ProfileKind::kPlain);
}

struct Fault {
  const char* what;
  const char* with;
  const char* told;  // must stand in the message
};

TEST_F(ScenarioFile, EveryFaultIsRefusedNamingFileAndKey) {
  const std::vector<Fault> faults = {
      {"name: probe", "name: other", "'name' must be that of the file"},
      {"name: probe\n", "", "'name' is missing"},
      {"title: A probe", "title: [A]", "'title'"},
      {"config: config", "config: nowhere", "nowhere', which is no folder"},
      {"config: config", "config: world.yaml", "world.yaml', which is no folder"},
      {"config: config\n", "", "'config' is missing"},
      {"first_seed: 1", "first_seed: 1\nprofile: canopen", "'profile'"},
      {"first_seed: 1", "first_seed: -1", "'first_seed'"},
      {"first_seed: 1", "first_seed: 1.5", "'first_seed'"},
      {"seeds: 3", "seeds: 0", "'seeds'"},
      {"seeds: 3", "seeds: many", "'seeds'"},
      {"seeds: 3", "seeds: 1000000000", "'seeds'"},
      {"model: dynamic", "model: magic", "'plant.model'"},
      {"load: loaded", "load: half", "'plant.load'"},
      {"rough_road: true", "rough_road: 2", "'plant.rough_road'"},
      {"variation: 0.2", "variation: 0.9", "'plant.variation'"},
      {", variation: 0.2", "", "'plant.variation' is missing"},
      {"variation: 0.2", "variation: 0.2, colour: red", "'plant.colour' is unknown"},
      {"kind: lane_change", "kind: race", "'experiment.kind'"},
      {"kind: lane_change", "kind: drive", "'experiment.world' is missing"},
      {"speed: 4.1667", "speed: .nan", "'experiment.speed'"},
      {"speed: 4.1667", "speed: -1", "'experiment.speed'"},
      {"offset: 10.0", "offset: '10.0'", "'experiment.offset'"},
      {"straights: [30.0, 30.0]", "straights: [30.0]", "'experiment.straights'"},
      {"straights: [30.0, 30.0]", "straights: [30.0, -1.0]", "'experiment.straights'"},
      {"change_length: 24.0", "change_length: 24.0\n  lanes: 3", "'experiment.lanes' is unknown"},
      {"metric: path_error_max", "metric: beauty", "'beauty' is no metric"},
      {"judge: every_seed", "judge: nobody", "judge"},
      {", max: 0.1", "", "needs a min or a max"},
      {"judge: report_only", "judge: report_only, max: 1.0", "report_only has no min or max"},
      {"max: 0.1", "min: 0.2, max: 0.1", "max"},
      {"paper: overlay plot, ", "", "paper' is missing"},
  };
  for (const Fault& fault : faults) {
    const std::string message = refusal(replaced(kGood, fault.what, fault.with));
    EXPECT_NE(message.find(fault.told), std::string::npos) << fault.with << " gave: " << message;
    EXPECT_NE(message.find("probe.yaml"), std::string::npos) << message;
  }
}

// Reading a device or a pipe would never end.
TEST_F(ScenarioFile, AWorldThatIsNoFileIsRefused) {
  for (const char* world : {"nowhere.yaml", "/dev/zero", "config", "pipe"}) {
    mkfifo((folder_ / "pipe").c_str(), 0600);
    const std::string message =
        refusal(replaced(kGood, "kind: lane_change", "kind: drive\n  world: " + std::string(world)));
    EXPECT_NE(message.find("'experiment.world' names '"), std::string::npos) << message;
    EXPECT_NE(message.find("which is no file"), std::string::npos) << message;
  }
}

TEST_F(ScenarioFile, WithoutGoalsIsRefused) {
  const std::string text = kGood.substr(0, kGood.find("goals:")) + "goals: []\n";
  EXPECT_NE(refusal(text).find("goals"), std::string::npos);
  EXPECT_NE(refusal(text), "accepted");
}

TEST_F(ScenarioFile, ThatIsNoYamlOrNotThereIsRefused) {
  EXPECT_NE(refusal("name: [unclosed"), "accepted");
  EXPECT_NE(refusal(""), "accepted");
  EXPECT_NE(refusal("- a\n- b\n"), "accepted");
  EXPECT_THROW(loadScenario((folder_ / "missing.yaml").string()), config::ConfigError);
}

TEST(Goal, HoldsInsideItsBoundsOnly) {
  const Goal goal{"lateral_mean", "-", Judge::kEverySeed, -0.02, 0.02};
  EXPECT_TRUE(goal.holds(0.02));
  EXPECT_FALSE(goal.holds(0.0201));
  EXPECT_FALSE(goal.holds(-0.03));
  EXPECT_FALSE(goal.holds(std::nan("")));
  EXPECT_GT(goal.badness(-0.03), goal.badness(0.025));
  EXPECT_GT(goal.badness(std::nan("")), goal.badness(1e9));
}

TEST(LaneChangePath, SingleChangeEndsBesideItsStartAndRisesAsAHalfCosine) {
  LaneChangeExperiment change{4.17, 10.0, 24.0, {30.0, 25.0}, 0.0, 0.0};
  const geometry::Path path = laneChangePath(change);
  const auto& last = path.points().back();
  EXPECT_NEAR(last.x, 30.0 + 24.0 + 25.0, 1e-9);
  EXPECT_NEAR(last.y, 10.0, 1e-9);
  EXPECT_NEAR(last.heading, 0.0, 1e-9);
  const geometry::PathProjection middle = path.project({42.0, 5.0});
  EXPECT_NEAR(middle.lateral_offset, 0.0, 1e-6);
  EXPECT_NEAR(std::tan(middle.heading), 5.0 * 3.14159265 / 24.0, 1e-4);
}

TEST(LaneChangePath, DoubleChangeComesBack) {
  LaneChangeExperiment change{4.17, 10.0, 24.0, {30.0, 25.0, 30.0}, 0.0, 0.0};
  EXPECT_NEAR(laneChangePath(change).points().back().y, 0.0, 1e-9);
}

TEST(LaneChangePath, ArcLengthIsThatOfTheCurve) {
  LaneChangeExperiment change{4.17, 10.0, 24.0, {30.0, 25.0}, 0.0, 0.0};
  double length = 55.0;  // the straights
  const int steps = 1'000'000;
  for (int i = 0; i < steps; ++i) {
    const double x = 24.0 * (i + 0.5) / steps;
    length += std::hypot(1.0, 5.0 * M_PI / 24.0 * std::sin(M_PI * x / 24.0)) * 24.0 / steps;
  }
  EXPECT_NEAR(laneChangePath(change).length(), length, 1e-4);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
