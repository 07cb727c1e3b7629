#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "../drivers/random_network.h"
#include "program.h"

namespace tunnel_pilot {
namespace {

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;

Outcome evaluate(const std::vector<std::string>& arguments) {
  return runProgram(EVALUATE_PROGRAM, arguments);
}

// The kinematic truck's return, short: a closed loop of a second or two.
std::string shortDrive(const std::string& goal) {
  return "name: short\ntitle: A short drive\nconfig: " + kPackage +
         "/config\nfirst_seed: 1000\nseeds: 3\n"
         "plant: {model: dynamic, load: loaded, rough_road: true, variation: 0.1}\n"
         "experiment:\n  kind: drive\n  world: " +
         kPackage +
         "/worlds/straight_8m.yaml\n  both_directions: true\n  station: 20.0\n  lateral_offset: 0.0\n"
         "  heading_error: 0.0\n  rolling_speed: 0.0\n  top_speed: 3.0\n  distance: 15.0\n"
         "  time_limit: 30.0\n  return_metrics: false\ngoals:\n  - " +
         goal + "\n";
}

class Evaluate : public ::testing::Test {
 protected:
  std::string scenario(const std::string& goal) {
    std::ofstream(place_.file("short.yaml")) << shortDrive(goal);
    return place_.file("short.yaml");
  }
  Workplace place_;
};

TEST_F(Evaluate, ExitsZeroWhenEveryGoalHolds) {
  const Outcome outcome =
      evaluate({scenario("{metric: completed, paper: '-', judge: every_seed, min: 1.0}")});
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("Every goal holds"), std::string::npos);
  EXPECT_NE(outcome.output.find("6 episodes"), std::string::npos) << "three seeds, both directions";
}

TEST_F(Evaluate, ExitsOneWhenAGoalIsMissed) {
  const Outcome outcome =
      evaluate({scenario("{metric: speed_mean, paper: '-', judge: every_seed, min: 100.0}")});
  EXPECT_EQ(outcome.status, 1) << outcome.output;
  EXPECT_NE(outcome.output.find("MISSED"), std::string::npos);
}

TEST_F(Evaluate, SameScenarioAndSeedsGiveTheSameBytesOnAnyNumberOfThreads) {
  const std::string file = scenario("{metric: lateral_rms, paper: '-', judge: every_seed, max: 9.0}");
  for (const auto& [folder, jobs] : {std::pair{"a", "1"}, std::pair{"b", "1"}, std::pair{"c", "2"}}) {
    ASSERT_EQ(evaluate({file, "--seeds", "2", "--out", place_.file(folder), "--jobs", jobs}).status, 0);
  }
  const auto first = contentsBelow(place_.file("a"));
  EXPECT_EQ(first, contentsBelow(place_.file("b")));
  EXPECT_EQ(first, contentsBelow(place_.file("c")));
  EXPECT_EQ(first.count("short/summary.json"), 1u);
  EXPECT_EQ(first.count("short/report.html"), 1u);
  EXPECT_EQ(first.count("short/episodes.csv"), 1u);
  EXPECT_EQ(first.count("short/seed_1000.csv"), 1u);
  EXPECT_EQ(first.count("short/seed_1001_reversed_perception.csv"), 1u);
  int pictures = 0;
  for (const auto& [name, content] : first) pictures += name.find(".png") != std::string::npos ? 1 : 0;
  EXPECT_EQ(pictures, 2) << "the median and the worst episode";
}

TEST_F(Evaluate, AnotherFirstSeedRunsOtherSeeds) {
  const std::string file = scenario("{metric: lateral_rms, paper: '-', judge: every_seed, max: 9.0}");
  ASSERT_EQ(
      evaluate({file, "--first-seed", "2000", "--seeds", "2", "--out", place_.file("a"), "--jobs", "2"})
          .status,
      0);
  const auto json = nlohmann::json::parse(contentOf(place_.file("a/short/summary.json")));
  EXPECT_EQ(json.at("episodes").front().at("seed"), 2000);
  EXPECT_EQ(json.at("episodes").back().at("seed"), 2001);
}

TEST_F(Evaluate, SummaryIsJsonWithTheFingerprintsOfWhatWasRun) {
  const std::string file = scenario("{metric: lateral_rms, paper: '-', judge: every_seed, max: 9.0}");
  ASSERT_EQ(evaluate({file, "--seeds", "1", "--out", place_.file("a")}).status, 0);
  const auto json = nlohmann::json::parse(contentOf(place_.file("a/short/summary.json")));
  EXPECT_TRUE(json.at("passed").get<bool>());
  for (const char* part : {"scenario", "controller", "plant", "world"}) {
    EXPECT_EQ(json.at("sha256").at(part).get<std::string>().size(), 64u) << part;
  }
  EXPECT_EQ(json.at("episodes").size(), 2u);
}

TEST_F(Evaluate, ReportIsOneWellFormedPageWithTheFiguresOfTheSummary) {
  const std::string file = scenario("{metric: lateral_rms, paper: '<&', judge: every_seed, max: 0.001}");
  ASSERT_EQ(evaluate({file, "--seeds", "2", "--out", place_.file("a"), "--jobs", "2"}).status, 1);
  const Outcome outcome = runProgram(
      "/usr/bin/python3", {kPackage + "/test/tools/check_report_page.py", place_.file("a/short")});
  EXPECT_EQ(outcome.status, 0) << outcome.output;
}

TEST_F(Evaluate, ReportTellsTheCommandThatGivesItAgain) {
  const std::string file = scenario("{metric: lateral_rms, paper: '-', judge: every_seed, max: 9.0}");
  ASSERT_EQ(evaluate({file, "--first-seed", "2000", "--seeds", "1", "--out", place_.file("a")}).status,
            0);
  EXPECT_NE(
      contentOf(place_.file("a/short/report.html"))
          .find("evaluate " + file + " --driver preview_driver --first-seed 2000 --seeds 1</code>"),
      std::string::npos);
}

TEST_F(Evaluate, ALidarDriversNetworkIsNamedInTheSummaryAndItsShareTold) {
  const std::string file =
      scenario("{metric: lidar_driver_share, paper: '-', judge: every_seed, min: 0.0}");
  neural::NetworkFile network = drivers::randomNetwork();
  neural::saveNetwork(place_.file("network.yaml"), network);
  for (const std::string driver : {"lidar_driver", "all"}) {
    const Outcome outcome = evaluate({file, "--seeds", "1", "--driver", driver, "--network",
                                      place_.file("network.yaml"), "--out", place_.file(driver)});
    ASSERT_EQ(outcome.status, 0) << outcome.output;
    const auto json = nlohmann::json::parse(contentOf(place_.file(driver + "/short/summary.json")));
    EXPECT_EQ(json.at("driver"), driver);
    EXPECT_EQ(json.at("sha256").at("network"), network.sha256);
    EXPECT_GT(json.at("episodes")[0].at("metrics").at("lidar_driver_share").get<double>(), 0.0);
  }
}

TEST_F(Evaluate, BadInputExitsTwoAndSaysWhy) {
  const std::string good = scenario("{metric: completed, paper: '-', judge: every_seed, min: 1.0}");
  std::string far = contentOf(good);
  far.replace(far.find("name: short"), 11, "name: far");
  far.replace(far.find("station: 20.0"), 13, "station: 300.0");
  std::ofstream(place_.file("far.yaml")) << far;
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{}, "scenario"},
      {{place_.file("far.yaml")}, "far.yaml: 'experiment.station' [m] lies beyond the end"},
      {{"nowhere.yaml"}, "nowhere.yaml"},
      {{good, "--seeds", "0"}, "--seeds"},
      {{good, "--seeds", "many"}, "seeds"},
      {{good, "--first-seed", "-1"}, "--first-seed"},
      {{good, "--first-seed", "1e9"}, "first-seed"},
      {{good, "--jobs", "0"}, "--jobs"},
      {{good, "--colour", "red"}, "colour"},
      {{good, "--driver", "somebody"}, "--driver"},
      {{good, "--network", "here.yaml"}, "--network"},
      {{good, "--driver", "lidar_driver", "--network", "nowhere.yaml"}, "nowhere.yaml: does not exist"},
      {{kPackage + "/scenarios/lane_change_single.yaml", "--driver", "all"},
       "lidar_driver cannot drive it"},
      {{good, "--config", place_.file("none")}, "none"},
      {{good, "--seeds", "1", "--out", "/dev/null/out"}, "/dev/null/out"},
      {{kPackage + "/config/truck.yaml"}, "truck.yaml"},
  };
  for (const auto& [arguments, told] : cases) {
    const Outcome outcome = evaluate(arguments);
    EXPECT_EQ(outcome.status, 2) << outcome.output;
    EXPECT_NE(outcome.output.find(told), std::string::npos) << outcome.output;
  }
}

TEST_F(Evaluate, AFolderThatCannotBeIsToldBeforeTheRuns) {
  const std::string good = scenario("{metric: completed, paper: '-', judge: every_seed, min: 1.0}");
  const Outcome outcome = evaluate({good, "--out", "/dev/null/out"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.output.find("episodes"), std::string::npos) << outcome.output;
}

TEST_F(Evaluate, HelpExplainsItsOptions) {
  const Outcome outcome = evaluate({"--help"});
  EXPECT_EQ(outcome.status, 0);
  for (const char* option : {"--first-seed", "--seeds", "--out", "--jobs", "--config", "--driver",
                             "--network", "Exit status"}) {
    EXPECT_NE(outcome.output.find(option), std::string::npos) << option;
  }
}

}  // namespace
}  // namespace tunnel_pilot
