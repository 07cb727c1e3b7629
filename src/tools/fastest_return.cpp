// fastest_return: how soon trucks could be back in the middle of a straight, whoever steers.
#include "tunnel_pilot/simulation/fastest_return.h"

#include <algorithm>
#include <boost/program_options.hpp>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr int kBadInput = 2;

struct Arguments {
  std::vector<std::string> scenarios;
  std::optional<std::uint64_t> first_seed;
  std::optional<int> seeds;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "fastest_return SCENARIO.yaml...: how soon the trucks of a return to the middle could be back, "
      "whoever\nsteers, and within which overshoot. Some 10 s a seed.\nOptions");
  std::uint64_t first_seed = 0;
  int seeds = 0;
  shown.add_options()("help,h", "this text")(
      "scenario", options::value(&arguments.scenarios)->required()->value_name("FILE"),
      "a return; also without the option's name")(
      "first-seed", options::value(&first_seed)->value_name("N"), "instead of the scenario's")(
      "seeds", options::value(&seeds)->value_name("N"), "number of seeds instead of the scenario's");
  options::positional_options_description positional;
  positional.add("scenario", -1);
  options::variables_map values;
  options::store(options::command_line_parser(argc, argv).options(shown).positional(positional).run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown;
    return false;
  }
  options::notify(values);
  if (values.count("first-seed") != 0) arguments.first_seed = first_seed;
  if (values.count("seeds") != 0) arguments.seeds = seeds;
  if (seeds < 0 || seeds > 100'000) throw options::error("--seeds must be 0 to 100000");
  return true;
}

double mostOvershoot(const simulation::Scenario& scenario) {
  for (const simulation::Goal& goal : scenario.goals) {
    if (goal.metric == "overshoot" && goal.max) return *goal.max;
  }
  throw std::runtime_error(scenario.file + ": no goal bounds the overshoot");
}

void run(const std::string& file, const Arguments& arguments) {
  const simulation::Scenario scenario = simulation::loadScenario(file);
  const auto* drive = std::get_if<simulation::DriveExperiment>(&scenario.experiment);
  if (drive == nullptr || !drive->return_metrics || drive->rolling_speed <= 0.0 ||
      drive->lateral_offset * drive->heading_error <= 0.0) {
    throw std::runtime_error(file + ": is no return by a rolling truck that heads away");
  }
  const simulation::Setup setup = simulation::loadSetup(scenario);
  const double most_overshoot = mostOvershoot(scenario);
  const std::uint64_t first = arguments.first_seed.value_or(scenario.first_seed);
  const auto seeds = static_cast<std::uint64_t>(arguments.seeds.value_or(scenario.seeds));
  std::printf("%s: fastest return\nseed   heading zero [s]   within 0.1 m [s]   overshoot [m]\n",
              scenario.name.c_str());
  std::vector<double> times;
  for (std::uint64_t seed = first; seed < first + seeds; ++seed) {
    const simulation::FastestReturn found =
        simulation::fastestReturn(*drive, scenario.plant, setup, seed, most_overshoot);
    times.push_back(found.settle_time);
    std::printf("%-6llu %16.2f   %16.2f   %13.3f\n", static_cast<unsigned long long>(seed),
                found.heading_zero_time, found.settle_time, found.overshoot);
    std::fflush(stdout);
  }
  if (times.empty()) return;
  std::printf("within 0.1 m, median / worst: %.2f / %.2f s\n", simulation::quantile(times, 0.5),
              *std::max_element(times.begin(), times.end()));
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return 0;
    for (const std::string& file : arguments.scenarios) run(file, arguments);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "fastest_return: " << error.what() << "\n";
    return kBadInput;
  }
}
