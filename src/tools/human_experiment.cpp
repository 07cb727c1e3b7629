// human_experiment: does a network learn to drive from a human who cuts bends, and without his cut?
#include <boost/program_options.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "tunnel_pilot/learning/human_drives.h"
#include "tunnel_pilot/simulation/scenario.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kBadInput = 2;

struct Arguments {
  std::string scenario;
  std::string recipe;
  std::string out;
  learning::HumanOptions human;
  int jobs = 2;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "human_experiment SCENARIO.yaml RECIPE.yaml --out DIR: a simulated human who cuts bends drives "
      "through\n"
      "tunnels of the scenario's kind. Two networks learn from his drives alone, one what he did, one "
      "with\n"
      "his cut measured and corrected. Each drives the scenario. Writes both networks and "
      "summary.json.\n"
      "Options");
  shown.add_options()("help,h", "this text")(
      "scenario", options::value(&arguments.scenario)->required()->value_name("FILE"),
      "drive in a world with an open design line; also without the option's name")(
      "recipe", options::value(&arguments.recipe)->required()->value_name("FILE"),
      "the networks' sizes and training; also without the option's name")(
      "out", options::value(&arguments.out)->required()->value_name("DIR"), "folder to write to")(
      "first-seed", options::value(&arguments.human.first_seed)->value_name("N"),
      "of the human's tunnels (1000)")("tunnels",
                                       options::value(&arguments.human.tunnels)->value_name("N"),
                                       "that the human drives through, both ways (80)")(
      "seeds", options::value(&arguments.human.evaluated)->value_name("N"),
      "that the networks drive, from the scenario's first one (20)")(
      "jobs", options::value(&arguments.jobs)->value_name("N"),
      "threads; the result does not depend on them (2)");
  options::positional_options_description positional;
  positional.add("scenario", 1).add("recipe", 1);
  options::variables_map values;
  options::store(options::command_line_parser(argc, argv).options(shown).positional(positional).run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 done, 1 training failed, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  const auto within = [](const char* name, int value, int most) {
    if (value >= 1 && value <= most) return;
    throw options::error(std::string(name) + " must be 1 to " + std::to_string(most));
  };
  within("--tunnels", arguments.human.tunnels, 1000);
  within("--seeds", arguments.human.evaluated, 1000);
  within("--jobs", arguments.jobs, 256);
  return true;
}

nlohmann::json summaryOf(const learning::InsideReport& report) {
  return {{"inside_mean", report.mean()},
          {"inside", report.inside},
          {"drives", report.drives},
          {"completed", report.completed}};
}

void experiment(const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  const simulation::Scenario scenario = simulation::loadScenario(arguments.scenario);
  learning::HumanReport report = learning::humanExperiment(
      scenario, simulation::loadSetup(scenario), arguments.human, learning::loadRecipe(arguments.recipe),
      arguments.jobs, [&](const std::string& line) {
        const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
        std::printf("%6.0f s  %s\n", passed.count(), line.c_str());
        std::fflush(stdout);
      });
  const std::filesystem::path folder = arguments.out;
  std::filesystem::create_directories(folder);
  neural::saveNetwork((folder / "raw.yaml").string(), *report.raw_network);
  neural::saveNetwork((folder / "corrected.yaml").string(), *report.corrected_network);
  const nlohmann::json summary = {{"scenario", scenario.name},
                                  {"human", summaryOf(report.human)},
                                  {"human_heading", report.human_heading},
                                  {"raw", summaryOf(report.raw)},
                                  {"corrected", summaryOf(report.corrected)}};
  std::ofstream(folder / "summary.json") << summary.dump(2) << "\n";
  std::printf("written: %s\n", (folder / "summary.json").c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  try {
    if (!parse(argc, argv, arguments)) return kDone;
    experiment(arguments);
    return kDone;
  } catch (const options::error& error) {
    std::cerr << "human_experiment: " << error.what() << " (try --help)\n";
    return kBadInput;
  } catch (const config::ConfigError& error) {
    std::cerr << "human_experiment: " << error.what() << "\n";
    return kBadInput;
  } catch (const std::invalid_argument& error) {
    std::cerr << "human_experiment: " << error.what() << "\n";
    return kBadInput;
  } catch (const std::exception& error) {
    std::cerr << "human_experiment: " << error.what() << "\n";
    return kFailed;
  }
}
