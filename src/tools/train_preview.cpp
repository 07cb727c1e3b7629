// train_preview: trains the network of preview_driver on lane changes and writes its file.
#include <boost/program_options.hpp>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "tunnel_pilot/learning/preview_training.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr int kBadInput = 2;

struct Arguments {
  learning::PreviewTrainingOptions training;
  std::string out;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "train_preview SCENARIO.yaml...: trains the 4-10-1 network of preview_driver.\nOptions");
  shown.add_options()("help,h", "this text")(
      "scenario", options::value(&arguments.training.scenarios)->required()->value_name("FILE"),
      "lane change to drive; also without the option's name")(
      "out", options::value(&arguments.out)->required()->value_name("FILE"), "network file to write")(
      "rounds", options::value(&arguments.training.rounds)->value_name("N"),
      "rounds of closed-loop drives")("seed", options::value(&arguments.training.seed)->value_name("N"),
                                      "of the first weights")(
      "jobs", options::value(&arguments.training.jobs)->value_name("N"), "threads");
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
  if (arguments.training.rounds < 0 || arguments.training.rounds > 1000) {
    throw options::error("--rounds must be 0 to 1000");
  }
  if (arguments.training.jobs < 1 || arguments.training.jobs > 256) {
    throw options::error("--jobs must be 1 to 256");
  }
  return true;
}

void tell(const learning::PreviewTrainingProgress& progress) {
  std::fprintf(stderr, "round %d: cost %.4f, largest path error %.2f of its goal%s\n", progress.round,
               progress.cost, progress.worst, progress.best ? ", best so far" : "");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return 0;
    neural::NetworkFile network = learning::trainPreviewNetwork(arguments.training, tell);
    neural::saveNetwork(arguments.out, network);
    std::cout << arguments.out << ": " << network.training << "\n";
    return 0;
  } catch (const std::exception& e) {
    std::cerr << "train_preview: " << e.what() << "\n";
    return kBadInput;
  }
}
