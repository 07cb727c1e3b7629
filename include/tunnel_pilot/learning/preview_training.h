#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tunnel_pilot/drivers/preview_network.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::learning {

struct PreviewTrainingOptions {
  std::vector<std::string> scenarios;  ///< files of the lane changes to drive, with the driver's config
  std::uint64_t seed = 1;              ///< of first weights and imitated situations
  int imitation_steps = 40000;         ///< of Adam, 32 situations each
  int rounds = 6;                      ///< of drives
  int drives = 4;                      ///< of each scenario in a round
  std::uint64_t first_seed = 1000;     ///< of the drives, another one for each
  std::uint64_t validation_seed = 3000;  ///< first of the drives that judge a round
  int validation_drives = 24;            ///< of each scenario
  double rate = 0.02;                    ///< eta of a preview time [rad/m]
  double momentum = 0.05;                ///< alpha [1]
  double bound = 0.05;                   ///< of a weight's way in one drive [rad]
  int jobs = 2;                          ///< threads of the validation
};

struct PreviewTrainingProgress {
  int round;     ///< 0: after the imitation
  double cost;   ///< mean over the validation of (largest path error / goal)^4
  double worst;  ///< largest path error over its goal, of the validation [1]
  bool best;     ///< of the rounds so far
};

/// What the preview law needs of truck and driver.
struct PreviewTruck {
  double wheelbase;     ///< l_f + l_r [m]
  double max_rate;      ///< of the hinge [rad/s]
  double preview_time;  ///< T_p [s]
};

/// The articulation that a preview network is to give, at its own speed [rad]. With the least mean
/// square of path less predicted place over T_p, more damping b and some foresight c by the present
/// acceleration,
///   a_y* = 2 [f_e - (5/3) y - b (5/4) T_p y' + c (f_e - T_p^2 y'' / 2)] / T_p^2,   u = C_0 a_y*
/// where the hinge needs long to turn to u at max_rate, the present acceleration lasts on: y' is then
/// what it will be after a share of that time. This is what the network's hidden nodes are for.
double previewLaw(const PreviewTruck& truck, const drivers::PreviewInputs& inputs);

/// Trains the 4-10-1 network of a preview driver in two phases:
/// 1. imitation of previewLaw() in drawn situations;
/// 2. the paper's online rule (PreviewNetwork) in closed loop: whole pilot, dynamic plant, steering with
///    its delays, sensor errors, as the scenarios say. Output weights go on from drive to drive; what a
///    round ends with is the mean of them over its drives. The round with the least cost on drives with
///    other seeds is kept, which may be the imitation itself.
/// Deterministic. Throws config::ConfigError for scenarios that cannot be read or are no lane changes
/// with a goal for path_error_max, neural::Diverged when the imitation diverges.
neural::NetworkFile trainPreviewNetwork(
    const PreviewTrainingOptions& options,
    const std::function<void(const PreviewTrainingProgress&)>& progress);

/// Phase 1 alone.
neural::NetworkFile imitatePreviewLaw(const PreviewTruck& truck, std::uint64_t seed, int steps);

}  // namespace tunnel_pilot::learning
