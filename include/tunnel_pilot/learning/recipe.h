#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/learning/network_trainer.h"
#include "tunnel_pilot/learning/scene_sampler.h"
#include "tunnel_pilot/learning/teacher.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::learning {

/// What the network takes, holds and gives.
struct NetworkDesign {
  struct Convolution {
    std::size_t channels, kernel, stride;
  };
  bool inverse_ranges;  ///< 1/r instead of r
  enum class Truck { kNone, kArticulation, kAll };
  Truck truck;                            ///< which of drivers::TruckInputs stand beside the scan
  std::vector<Convolution> convolutions;  ///< over the scan, rectified
  std::vector<std::size_t> hidden;        ///< dense layers
  neural::Activation activation;          ///< theirs
  bool gaussian;                          ///< 31 outputs of a Gaussian code; else the angle alone
  double small_lead_share;                ///< neural::OutputGroup's [1]
};

/// Scenes of one world file (sampleScenes).
struct SceneSource {
  std::string world_file;
  int tunnels;           ///< seeds
  std::size_t examples;  ///< of each
  SceneSpread spread;
};

/// Drives of the network itself, labelled by the teacher: one scenario with other seeds, the plant off.
struct DriveSource {
  std::string scenario_file;
  int tunnels;       ///< seeds a round, each in the scenario's directions
  double variation;  ///< of the plant's parameters [1]
  double speed_min,
      speed_max;           ///< top speed and, in a scenario that starts rolling, rolling speed [m/s]
  double offset, heading;  ///< largest at the start, for a scenario that starts rolling [m rad]
};

/// recipes/*.yaml: everything that makes a network, but for the code. Seeds: scenes from `seed` on, one
/// thousand numbers to each source; the drives' behind them.
struct Recipe {
  std::string file;
  std::string name;
  std::string base_scenario;  ///< its plant and parameters are those of the scenes
  std::uint64_t seed;
  NetworkDesign design;
  TeacherParameters teacher;
  std::vector<SceneSource> scenes;
  std::vector<DriveSource> drives;
  int rounds;                ///< of drives: training follows each
  int held_out;              ///< scenes' tunnels of each source that are not trained on
  int epochs_between;        ///< of the trainings before the last one
  TrainingOptions training;  ///< of the last one
};

/// Reads and checks a recipe; files in it are relative to it. Throws config::ConfigError.
Recipe loadRecipe(const std::string& file);

/// An untrained network of a design.
neural::NetworkFile makeNetwork(const NetworkDesign& design, const std::string& name);

/// Follows a recipe: samples scenes, trains, drives, adds what the drives showed, trains again. With
/// `data` (read from files, tunnels of their own), that takes the place of scenes and drives, and every
/// fifth tunnel is held out. `tell` gets lines for people. The result's training text says how it came
/// about. `jobs` threads drive; the result does not depend on them. Throws config::ConfigError,
/// neural::Diverged, std::invalid_argument.
neural::NetworkFile follow(const Recipe& recipe, const DataSet* data, int jobs,
                           const std::function<void(const std::string&)>& tell);

}  // namespace tunnel_pilot::learning
