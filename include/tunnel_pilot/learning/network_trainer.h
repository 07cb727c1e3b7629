#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::learning {

struct TrainingOptions {
  int epochs = 20;
  int patience = 100;            ///< epochs without a lower error on the held-out tunnels, then it stops
  double rate = 1e-3;            ///< Adam's; falls along a cosine to a hundredth of it
  double weight_decay = 0.0;     ///< a step and rate [1]
  std::size_t components = 120;  ///< principal components that a dense first layer is trained on; 0: raw
  std::uint64_t seed = 1;
};

struct TrainingProgress {
  int epoch;               ///< from 1
  double loss;             ///< mean over the epoch [1]
  double validation_loss;  ///< [1]
  double validation_rms;   ///< of the angle that the outputs tell [rad]
};

/// Trains the network of a lidar driver from its present parameters, or from new random ones where the
/// first layer is trained on principal components (InputProjection). Every example is shown as often
/// mirrored as not. Loss: cross-entropy on the Gaussian code's probabilities (crossEntropy), or half the
/// squared error of a single output. Two threads, with the same result on any machine. Keeps the
/// parameters of the epoch with the least error on `validation`, examples from tunnels held out.
/// Throws std::invalid_argument without examples, neural::Diverged when something is no longer finite;
/// the network is then as it was.
void trainNetwork(neural::NetworkFile& file, const DataSet& examples, const DataSet& validation,
                  const TrainingOptions& options,
                  const std::function<void(const TrainingProgress&)>& progress);

}  // namespace tunnel_pilot::learning
