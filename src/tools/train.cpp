// train: makes a network as a recipe says, from simulated drives or from recorded ones.
#include <boost/program_options.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "tunnel_pilot/learning/data_file.h"
#include "tunnel_pilot/learning/recipe.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kBadInput = 2;

struct Arguments {
  std::string recipe;
  std::string out;
  std::vector<std::string> data;
  int jobs = 2;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown("train RECIPE.yaml --out NETWORK.yaml: trains a network.\nOptions");
  shown.add_options()("help,h", "this text")(
      "recipe", options::value(&arguments.recipe)->required()->value_name("FILE"),
      "recipe file; also without the option's name")(
      "out", options::value(&arguments.out)->required()->value_name("FILE"), "network file to write")(
      "data", options::value(&arguments.data)->multitoken()->value_name("FILE..."),
      "data sets of extract: learns from these instead of the recipe's scenes and drives")(
      "jobs", options::value(&arguments.jobs)->default_value(2)->value_name("N"),
      "threads that drive; the result does not depend on them");
  options::positional_options_description positional;
  positional.add("recipe", 1);
  options::variables_map values;
  options::store(options::command_line_parser(argc, argv).options(shown).positional(positional).run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 written, 1 training failed, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  if (arguments.jobs < 1 || arguments.jobs > 256) throw options::error("--jobs must be 1 to 256");
  return true;
}

void train(const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  const learning::Recipe recipe = learning::loadRecipe(arguments.recipe);
  learning::DataSet data;
  for (const std::string& file : arguments.data) learning::append(data, learning::readDataSet(file));
  const learning::DataSet* recorded = arguments.data.empty() ? nullptr : &data;
  neural::NetworkFile network =
      learning::follow(recipe, recorded, arguments.jobs, [&](const std::string& line) {
        const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
        std::printf("%6.0f s  %s\n", passed.count(), line.c_str());
        std::fflush(stdout);
      });
  neural::saveNetwork(arguments.out, network);
  std::printf("written: %s, SHA-256 %s\n", arguments.out.c_str(), network.sha256.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  try {
    if (!parse(argc, argv, arguments)) return kDone;
    train(arguments);
    return kDone;
  } catch (const options::error& error) {
    std::cerr << "train: " << error.what() << " (try --help)\n";
    return kBadInput;
  } catch (const config::ConfigError& error) {
    std::cerr << "train: " << error.what() << "\n";
    return kBadInput;
  } catch (const std::exception& error) {
    std::cerr << "train: " << error.what() << "; nothing was written\n";
    return kFailed;
  }
}
