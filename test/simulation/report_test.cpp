#include "tunnel_pilot/simulation/report.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "tunnel_pilot/simulation/chart.h"

namespace tunnel_pilot::simulation {
namespace {

const vehicle::TruckGeometry& truck() {
  static const vehicle::TruckGeometry geometry =
      vehicle::loadTruck(TUNNEL_PILOT_SOURCE_DIR "/config/truck.yaml").geometry;
  return geometry;
}

Scenario probe(std::vector<Goal> goals) {
  Scenario scenario;
  scenario.name = "probe";
  scenario.title = "A probe";
  scenario.seeds = 3;
  scenario.experiment = DriveExperiment{};
  scenario.goals = std::move(goals);
  return scenario;
}

std::vector<EpisodeResult> episodesWith(const std::string& metric, const std::vector<double>& values) {
  std::vector<EpisodeResult> episodes;
  for (const double value : values) {
    EpisodeResult episode;
    episode.seed = episodes.size() + 1;
    episode.ending = "one lap";
    episode.metrics[metric] = value;
    episode.line = geometry::buildPath({{60.0, 0.0, 0.0}}, {}, 0.5);
    const double y = std::isfinite(value) ? value : 0.0;
    for (int i = 0; i < 100; ++i) {
      TrackSample sample;
      sample.time = 0.1 * i;
      sample.station = 0.5 * i;
      sample.front = {0.5 * i, y, 0.0};
      sample.rear = {0.5 * i - 5.12, y, 0.0};
      sample.lateral_offset = y;
      sample.clearance = 0.9;
      sample.speed = 3.0;
      episode.track.push_back(sample);
    }
    episode.walls = {{{-5.0, 2.5}, {60.0, 2.5}}, {{-5.0, -2.5}, {60.0, -2.5}}};
    episodes.push_back(episode);
  }
  return episodes;
}

std::string contentOf(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::map<std::string, std::string> contentsOf(const std::filesystem::path& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    contents[entry.path().filename().string()] = contentOf(entry.path());
  }
  return contents;
}

class ReportFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("report_test_" + std::to_string(::getpid()));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string sub(const std::string& name) const { return (folder_ / name).string(); }
  std::filesystem::path folder_;
};

TEST(Judge, EverySeedMustHold) {
  const Goal goal{"lateral_rms", "-", Judge::kEverySeed, {}, 0.1};
  EXPECT_TRUE(judge(probe({goal}), episodesWith("lateral_rms", {0.05, 0.1, 0.02})).passed);
  const Evaluation failed = judge(probe({goal}), episodesWith("lateral_rms", {0.05, 0.11, 0.02}));
  EXPECT_FALSE(failed.passed);
  EXPECT_DOUBLE_EQ(failed.goals[0].worst, 0.11);
  EXPECT_EQ(failed.goals[0].worst_episode, "seed 2");
  EXPECT_DOUBLE_EQ(failed.goals[0].median, 0.05);
}

TEST(Judge, AMedianGoalForgivesTheWorst) {
  const Goal goal{"lateral_rms", "-", Judge::kMedian, {}, 0.1};
  EXPECT_TRUE(judge(probe({goal}), episodesWith("lateral_rms", {0.05, 0.5, 0.02})).passed);
  EXPECT_FALSE(judge(probe({goal}), episodesWith("lateral_rms", {0.15, 0.5, 0.02})).passed);
}

TEST(Judge, WorstOfATwoSidedGoalIsTheFarthestOut) {
  const Goal goal{"lateral_mean", "-", Judge::kEverySeed, -0.02, 0.02};
  EXPECT_DOUBLE_EQ(
      judge(probe({goal}), episodesWith("lateral_mean", {0.015, -0.019, 0.0})).goals[0].worst, -0.019);
}

TEST(Judge, AMissingMetricAndNoEpisodesFail) {
  const Goal goal{"lateral_rms", "-", Judge::kEverySeed, {}, 0.1};
  EXPECT_FALSE(judge(probe({goal}), episodesWith("lateral_max", {0.0})).passed);
  EXPECT_FALSE(judge(probe({goal}), {}).passed);
}

TEST(Judge, ReportOnlyNeverFails) {
  EXPECT_TRUE(judge(probe({{"lateral_rms", "-", Judge::kReportOnly, {}, {}}}),
                    episodesWith("lateral_rms", {1e9}))
                  .passed);
}

TEST(Table, ShowsPaperGoalMedianWorstAndVerdictInTheMetricsUnit) {
  const Scenario scenario = probe({{"heading_mean", "-0.47 deg", Judge::kReportOnly, {}, {}},
                                   {"lateral_mean", "-54 mm", Judge::kEverySeed, -0.02, 0.02}});
  auto episodes = episodesWith("lateral_mean", {0.01, 0.03});
  for (EpisodeResult& episode : episodes) episode.metrics["heading_mean"] = 0.017453292519943295;
  const std::string text = table(scenario, judge(scenario, episodes));
  EXPECT_NE(text.find("-54 mm     -20 .. 20"), std::string::npos) << text;
  EXPECT_NE(text.find("20     30  MISSED"), std::string::npos) << text;
  EXPECT_NE(text.find("[deg]"), std::string::npos) << text;
}

TEST_F(ReportFolder, SameResultsGiveTheSameBytes) {
  const Scenario scenario = probe({{"lateral_rms", "-", Judge::kEverySeed, {}, 0.1}});
  const auto episodes = episodesWith("lateral_rms", {0.01, 0.2, 0.03});
  for (const char* name : {"a", "b"}) {
    writeReport(sub(name), scenario, judge(scenario, episodes), episodes, {"1", "2", "3", "4"}, truck());
  }
  const auto first = contentsOf(sub("a"));
  EXPECT_EQ(first, contentsOf(sub("b")));
  EXPECT_EQ(first.count("summary.json"), 1u);
  EXPECT_EQ(first.count("episodes.csv"), 1u);
  EXPECT_EQ(first.count("seed_3.csv"), 1u);
  EXPECT_EQ(first.count("seed_2.png"), 1u) << "the worst episode has a picture";
}

TEST_F(ReportFolder, SummaryHoldsGoalsEpisodesAndFingerprints) {
  const Scenario scenario = probe({{"lateral_rms", "-", Judge::kEverySeed, {}, 0.1}});
  const auto episodes = episodesWith("lateral_rms", {0.01, INFINITY});
  writeReport(sub("a"), scenario, judge(scenario, episodes), episodes, {"aa", "bb", "cc", "dd"},
              truck());
  const auto json = nlohmann::json::parse(contentOf(folder_ / "a" / "summary.json"));
  EXPECT_FALSE(json.at("passed").get<bool>());
  EXPECT_EQ(json.at("sha256").at("plant"), "cc");
  EXPECT_EQ(json.at("goals").at(0).at("max"), 0.1);
  EXPECT_TRUE(json.at("goals").at(0).at("worst").is_null()) << "infinity has no JSON number";
  EXPECT_EQ(json.at("episodes").size(), 2u);
}

TEST_F(ReportFolder, ThatCannotBeMadeIsTold) {
  const Scenario scenario = probe({{"lateral_rms", "-", Judge::kEverySeed, {}, 0.1}});
  const auto episodes = episodesWith("lateral_rms", {0.01});
  EXPECT_THROW(
      writeReport("/dev/null/report", scenario, judge(scenario, episodes), episodes, {}, truck()),
      std::runtime_error);
}

TEST(Chart, DrawsItsLineWhereItsValuesAre) {
  Chart chart("title", "x [m]", "y [m]");
  chart.line({{0.0, 1.0}, {10.0, 1.0}}, cv::Scalar(0, 0, 255), "", 3.0);
  chart.includeY(0.0, 2.0);
  const cv::Mat image = chart.draw(600, 300);
  int red_rows = 0, first = -1, last = -1;
  for (int row = 0; row < image.rows; ++row) {
    const auto pixel = image.at<cv::Vec3b>(row, 300);
    if (pixel[2] > 150 && pixel[0] < 100) {
      ++red_rows;
      if (first < 0) first = row;
      last = row;
    }
  }
  EXPECT_GE(red_rows, 2);
  EXPECT_LE(red_rows, 5);
  EXPECT_NEAR(0.5 * (first + last), 44 + 0.5 * (300 - 100), 2.0) << "the middle of the axes box";
}

TEST(Chart, DrawsNothingAndNonFiniteNumbersWithoutFault) {
  Chart empty("title", "x", "y");
  EXPECT_EQ(empty.draw(400, 300).cols, 400);
  Chart odd("title", "x", "y");
  odd.line({{0.0, NAN}, {1.0, 1.0}, {INFINITY, 2.0}, {3.0, 1.0}}, colour::kBlue, "odd");
  odd.equalAxes();
  EXPECT_EQ(odd.draw(400, 300).rows, 300);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
