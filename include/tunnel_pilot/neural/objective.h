#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/loss.h"
#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural {

/// What a trainer makes small: E at `parameters`, and dE/dp in `gradient` unless that is null.
using Objective =
    std::function<double(const std::vector<double>& parameters, std::vector<double>* gradient)>;

/// What Levenberg-Marquardt makes small, as a sum of squares: errors (target minus output) at
/// `parameters`, and in `jacobian`, unless that is null, d output / d parameter, one row an error.
using Residuals = std::function<void(const std::vector<double>& parameters, std::vector<double>& errors,
                                     std::vector<double>* jacobian)>;

/// Inputs and targets of a network, sample after sample.
struct Samples {
  std::vector<double> inputs;
  std::vector<double> targets;
};

/// A network's mean loss over samples, as an Objective. The network takes over the parameters it is
/// asked for; network and samples must outlive it. Throws std::invalid_argument for samples that do not
/// suit the network. Allocates nothing after construction.
class NetworkObjective {
 public:
  NetworkObjective(Network& network, const Samples& samples, Loss loss);
  double operator()(const std::vector<double>& parameters, std::vector<double>* gradient);

 private:
  double batch(std::size_t first, std::vector<double>* gradient);

  Network* network_;
  const Samples* samples_;
  Loss loss_;
  std::size_t count_;
  BatchPass pass_;
};

/// A network's errors over samples, and the Jacobian of its outputs, as Residuals: row
/// sample * outputs + output. As NetworkObjective otherwise.
class NetworkResiduals {
 public:
  NetworkResiduals(Network& network, const Samples& samples);
  void operator()(const std::vector<double>& parameters, std::vector<double>& errors,
                  std::vector<double>* jacobian);

 private:
  void differentiate(std::size_t lane, std::size_t first_row, std::vector<double>& jacobian);

  Network* network_;
  const Samples* samples_;
  std::size_t count_;
  BatchPass pass_;
  std::vector<double> row_;
};

}  // namespace tunnel_pilot::neural
