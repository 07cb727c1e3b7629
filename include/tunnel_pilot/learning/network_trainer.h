#pragma once

#include <cstdint>
#include <functional>

#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::learning {

struct TrainingOptions {
  int epochs = 20;
  double rate = 1e-3;        ///< Adam's, falls along a cosine to a hundredth of it
  double weight_decay = 0.0;
  double decode_weight = 0.0;  ///< of the squared error of the decoded angle, in spacings
  bool mirror = true;        ///< show every example mirrored as often as not
  std::size_t components = 100;  ///< principal components trained on; 0: the raw inputs
  std::uint64_t seed = 1;
  int threads = 2;
};

struct TrainingProgress {
  int epoch;               ///< from 1
  double loss;             ///< mean of the epoch
  double validation_loss;
  double validation_rms;   ///< of the decoded angle [rad]
};

/// Trains a lidar driver's network. Keeps the parameters of the epoch with the least validation error.
/// Throws std::runtime_error when the loss is no longer finite; the network is then as it was.
void trainNetwork(neural::NetworkFile& file, const DataSet& examples, const DataSet& validation,
                  const TrainingOptions& options,
                  const std::function<void(const TrainingProgress&)>& progress);

}  // namespace tunnel_pilot::learning
