#pragma once

#include <cstddef>
#include <vector>

namespace tunnel_pilot::neural {

struct AdamParameters {
  double rate = 1e-3;
  double beta1 = 0.9;     ///< decay of the gradient's mean, in [0, 1)
  double beta2 = 0.999;   ///< decay of its mean square, in [0, 1)
  double epsilon = 1e-8;  ///< added to the root of the mean square
  double weight_decay =
      0.0;  ///< of every parameter towards 0, a step and rate (Loshchilov & Hutter 2019)
};

/// Adam (Kingma & Ba 2015, algorithm 1), with weight decay apart from the gradient:
///   m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,
///   p -= rate (m / (1 - b1^t) / (sqrt(v / (1 - b2^t)) + epsilon) + decay p).
/// Allocates nothing after construction. Throws std::invalid_argument for parameters out of range and
/// vectors of another size, Diverged for a gradient or parameter that is not finite.
class Adam {
 public:
  Adam(std::size_t parameters, const AdamParameters& settings);

  /// One step down `gradient`, at `rate_factor` times the rate (for a schedule).
  void step(std::vector<double>& parameters, const std::vector<double>& gradient,
            double rate_factor = 1.0);

 private:
  AdamParameters settings_;
  std::vector<double> mean_, mean_square_;
  double power1_ = 1.0, power2_ = 1.0;  // beta^t
};

}  // namespace tunnel_pilot::neural
