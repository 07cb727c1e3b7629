// evaluate: runs a scenario without ROS, holds it against its goals, writes a report.
#include <unistd.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "tunnel_pilot/simulation/episode.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr int kGoalsHold = 0;
constexpr int kGoalMissed = 1;
constexpr int kBadInput = 2;

struct Arguments {
  std::vector<std::string> scenarios;
  std::string out;
  std::string config;
  std::string driver;
  std::string network;
  std::string can_log;
  long long first_seed = -1;  // -1: the scenario's
  int seeds = 0;
  int jobs = 1;
};

simulation::DriverChoice driverOf(const Arguments& arguments) {
  using simulation::DriverChoice;
  for (const DriverChoice choice :
       {DriverChoice::kPreviewDriver, DriverChoice::kLidarDriver, DriverChoice::kAll}) {
    if (toString(choice) == arguments.driver) return choice;
  }
  throw options::error("--driver must be preview_driver, lidar_driver or all");
}

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "evaluate SCENARIO.yaml...: runs scenarios and judges them.\nOptions");
  shown.add_options()("help,h", "this text")(
      "scenario", options::value(&arguments.scenarios)->required()->value_name("FILE"),
      "scenario file; also without the option's name")("seeds",
                                                       options::value(&arguments.seeds)->value_name("N"),
                                                       "number of seeds instead of the scenario's")(
      "first-seed", options::value(&arguments.first_seed)->value_name("N"),
      "first seed instead of the scenario's")("out", options::value(&arguments.out)->value_name("DIR"),
                                              "writes report.html, summary.json, CSV files and plots to "
                                              "DIR/<scenario>; without it only the table "
                                              "is printed")(
      "config", options::value(&arguments.config)->value_name("DIR"),
      "parameter files instead of the scenario's")(
      "driver", options::value(&arguments.driver)->default_value("preview_driver")->value_name("NAME"),
      "who proposes: preview_driver, lidar_driver, or all (lidar_driver steers while it is sure)")(
      "network", options::value(&arguments.network)->value_name("FILE"),
      "lidar_driver's network instead of the one that config/lidar_driver.yaml names")(
      "can-log", options::value(&arguments.can_log)->value_name("FILE"),
      "writes the first episode's CAN bus and its events (candump -L)")(
      "jobs", options::value(&arguments.jobs)->default_value(1)->value_name("N"), "threads");
  options::positional_options_description positional;
  positional.add("scenario", -1);
  options::variables_map values;
  options::store(options::command_line_parser(argc, argv).options(shown).positional(positional).run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 every goal holds, 1 a goal is missed, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  if (values.count("seeds") != 0 && (arguments.seeds < 1 || arguments.seeds > 100'000)) {
    throw options::error("--seeds must be 1 to 100000");
  }
  if (values.count("first-seed") != 0 &&
      (arguments.first_seed < 0 || arguments.first_seed > 1'000'000'000)) {
    throw options::error("--first-seed must be 0 to 1000000000");
  }
  if (!arguments.can_log.empty() && arguments.scenarios.size() > 1) {
    throw options::error("--can-log takes one scenario");
  }
  if (arguments.jobs < 1 || arguments.jobs > 256) throw options::error("--jobs must be 1 to 256");
  const simulation::DriverChoice driver = driverOf(arguments);
  if (driver == simulation::DriverChoice::kPreviewDriver && !arguments.network.empty()) {
    throw options::error("--network is of no use without --driver lidar_driver or all");
  }
  return true;
}

class ProgressLine {
 public:
  ProgressLine(std::string name, std::size_t total) : name_(std::move(name)), total_(total) { show(0); }

  void show(std::size_t done) {
    const bool last = done == total_;
    if (!terminal_ && !last) return;
    const double elapsed =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    std::fprintf(stderr, "%s%s: %zu of %zu episodes, %.1f s%s", terminal_ ? "\r" : "", name_.c_str(),
                 done, total_, elapsed, last ? "\n" : "");
    std::fflush(stderr);
  }

 private:
  std::string name_;
  std::size_t total_;
  bool terminal_ = isatty(2) != 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

double simulatedTime(const std::vector<simulation::EpisodeResult>& episodes) {
  double sum = 0.0;
  for (const simulation::EpisodeResult& episode : episodes) {
    if (!episode.track.empty()) sum += episode.track.back().time - episode.track.front().time;
  }
  return sum;
}

// How the episodes ended: "way driven (19), contact (1)".
std::string endings(const std::vector<simulation::EpisodeResult>& episodes) {
  std::map<std::string, int> counts;
  for (const simulation::EpisodeResult& episode : episodes) ++counts[episode.ending];
  std::string text;
  for (const auto& [ending, count] : counts) {
    text += (text.empty() ? "" : ", ") + ending + " (" + std::to_string(count) + ")";
  }
  return text;
}

// Which network drove, and how long.
std::string networkLine(const neural::NetworkFile& network,
                        const std::vector<simulation::EpisodeResult>& episodes) {
  double share = 0.0;
  int drives = 0;
  for (const simulation::EpisodeResult& episode : episodes) {
    const auto found = episode.metrics.find("lidar_driver_share");
    if (found == episode.metrics.end()) continue;
    share += found->second;
    ++drives;
  }
  char text[64];
  std::snprintf(text, sizeof text, " steered %.1f %% of the time.", 100.0 * share / std::max(drives, 1));
  return "Network " + network.name + " " + network.sha256.substr(0, 12) + text;
}

// Opens the log of the first episode's bus. Throws std::runtime_error.
std::ofstream openCanLog(const std::string& file, const simulation::Scenario& scenario) {
  const auto& experiment = scenario.experiment;
  if (!std::holds_alternative<simulation::DriveExperiment>(experiment) &&
      !std::holds_alternative<simulation::LaneChangeExperiment>(experiment)) {
    throw std::runtime_error("--can-log: there is no bus in " + scenario.name);
  }
  std::ofstream log(file);
  if (!log) throw std::runtime_error("--can-log: cannot write " + file);
  return log;
}

// What gives the same results again. --out and --jobs are left out: no result depends on them.
std::string commandOf(const std::string& file, const Arguments& arguments) {
  std::string command = "evaluate " + file;
  const auto add = [&command](const std::string& option, const std::string& value) {
    if (!value.empty()) command += " --" + option + " " + value;
  };
  add("config", arguments.config);
  add("driver", arguments.driver);
  add("network", arguments.network);
  add("first-seed", arguments.first_seed >= 0 ? std::to_string(arguments.first_seed) : "");
  add("seeds", arguments.seeds > 0 ? std::to_string(arguments.seeds) : "");
  return command;
}

// True when every goal of the scenario holds.
bool evaluate(const std::string& file, const Arguments& arguments) {
  simulation::Scenario scenario = simulation::loadScenario(file);
  if (!arguments.config.empty()) scenario.config_folder = arguments.config;
  if (arguments.first_seed >= 0) scenario.first_seed = static_cast<std::uint64_t>(arguments.first_seed);
  const int seeds = arguments.seeds > 0 ? arguments.seeds : scenario.seeds;
  simulation::Setup setup = simulation::loadSetup(scenario);
  simulation::chooseDriver(scenario, driverOf(arguments), arguments.network, setup);
  setup.fingerprints.command = commandOf(file, arguments);
  auto plans = simulation::episodePlans(scenario, seeds);
  std::ofstream can_log;
  if (!arguments.can_log.empty()) {
    can_log = openCanLog(arguments.can_log, scenario);
    plans.front().can_log = &can_log;
  }
  const std::string folder = arguments.out.empty() ? "" : arguments.out + "/" + scenario.name;
  if (!folder.empty())
    simulation::makeReportFolder(folder);  // one that cannot be is told before the runs

  ProgressLine progress(scenario.name, plans.size());
  const auto start = std::chrono::steady_clock::now();
  const auto episodes = simulation::runEpisodes(scenario, setup, plans, arguments.jobs,
                                                [&](std::size_t done) { progress.show(done); });
  if (can_log.is_open() && !can_log.flush()) {
    throw std::runtime_error("--can-log: cannot write " + arguments.can_log);
  }
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const simulation::Evaluation evaluation = simulation::judge(scenario, episodes);
  std::cout << simulation::table(scenario, evaluation);
  std::printf("%zu episodes, %.0f times real time: %s. %s\n\n", episodes.size(),
              simulatedTime(episodes) / std::max(elapsed, 1e-9), endings(episodes).c_str(),
              evaluation.passed ? "Every goal holds." : "A goal is MISSED.");
  if (setup.pilot.network) std::printf("%s\n\n", networkLine(*setup.pilot.network, episodes).c_str());
  std::fflush(stdout);
  if (!folder.empty()) {
    simulation::writeReport(folder, scenario, evaluation, episodes, setup.fingerprints,
                            setup.truck.geometry);
  }
  return evaluation.passed;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return kGoalsHold;
    bool passed = true;
    for (const std::string& file : arguments.scenarios) passed = evaluate(file, arguments) && passed;
    return passed ? kGoalsHold : kGoalMissed;
  } catch (const std::exception& error) {
    std::cerr << "evaluate: " << error.what() << "\n";
    return kBadInput;
  }
}
