#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>

#include "program.h"

namespace tunnel_pilot {
namespace {

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;

Outcome soak(const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {
      "--scenario", kPackage + "/scenarios/default_drift.yaml", "--hours", "0.2", "--seed", "1000"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return runProgram(SOAK_PROGRAM, arguments);
}

// Of all stops of a kind: how many, and how many of them missed.
std::pair<int, int> stopsBy(const std::string& kind, const std::string& output) {
  std::smatch row;
  const std::regex pattern("\\| " + kind + R"( \| (\d+) \|[^\n]*\| (\d+) \|\n)");
  if (!std::regex_search(output, row, pattern)) return {-1, -1};
  return {std::stoi(row[1]), std::stoi(row[2])};
}

TEST(Soak, KeepsEveryLimitAndIsTheSameEachTime) {
  const Outcome first = soak({});
  EXPECT_EQ(first.status, 0) << first.output;
  const auto [bus_down, missed] = stopsBy("bus down", first.output);
  EXPECT_GE(bus_down, 1) << first.output;
  EXPECT_EQ(missed, 0) << first.output;
  const auto table = [](const Outcome& outcome) {
    const std::size_t begin = outcome.output.find("| stop");
    return outcome.output.substr(begin, outcome.output.find("| after") - begin);
  };
  EXPECT_EQ(table(first), table(soak({})));
}

// A truck that waits longer for a command than it may, when the bus is down.
TEST(Soak, TellsAStopThatComesTooLate) {
  const Workplace place;
  std::filesystem::copy(kPackage + "/config", place.file("config"),
                        std::filesystem::copy_options::recursive);
  std::filesystem::create_directory_symlink(kPackage + "/networks", place.file("networks"));
  std::string controller = contentOf(place.file("config/truck_controller.yaml"));
  const std::string timeout = "command_timeout: 0.10";
  ASSERT_NE(controller.find(timeout), std::string::npos);
  controller.replace(controller.find(timeout), timeout.size(), "command_timeout: 0.30");
  std::ofstream(place.file("config/truck_controller.yaml")) << controller;
  const Outcome outcome = soak({"--config", place.file("config")});
  EXPECT_EQ(outcome.status, 1) << outcome.output;
  const auto [bus_down, missed] = stopsBy("bus down", outcome.output);
  EXPECT_GE(bus_down, 1) << outcome.output;
  EXPECT_EQ(missed, bus_down) << outcome.output;
  EXPECT_EQ(stopsBy("operator's stop", outcome.output).second, 0) << outcome.output;
}

TEST(Soak, ExitsTwoForBadInput) {
  const std::string drift = kPackage + "/scenarios/default_drift.yaml";
  EXPECT_EQ(runProgram(SOAK_PROGRAM, {"--scenario", drift, "--hours", "0"}).status, 2);
  EXPECT_EQ(runProgram(SOAK_PROGRAM, {"--scenario", kPackage + "/scenarios/steady_turn.yaml"}).status,
            2);
  EXPECT_EQ(runProgram(SOAK_PROGRAM, {"--scenario", kPackage + "/scenarios/unseen_drifts.yaml"}).status,
            2)
      << "an open way";
}

}  // namespace
}  // namespace tunnel_pilot
