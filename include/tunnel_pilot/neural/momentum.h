#pragma once

#include <cstddef>
#include <vector>

namespace tunnel_pilot::neural {

struct MomentumParameters {
  double rate = 0.05;
  double momentum = 0.9;  ///< share of the last change, in [0, 1); 0 is plain gradient descent
};

/// Gradient descent with momentum (Rumelhart, Hinton & Williams 1986): d = momentum d - rate g, p += d.
/// Allocates nothing after construction. Throws std::invalid_argument for parameters out of range and
/// vectors of another size, Diverged for a gradient or parameter that is not finite.
class Momentum {
 public:
  Momentum(std::size_t parameters, const MomentumParameters& settings);

  /// One step down `gradient`, at `rate_factor` times the rate (for a schedule).
  void step(std::vector<double>& parameters, const std::vector<double>& gradient,
            double rate_factor = 1.0);

 private:
  MomentumParameters settings_;
  std::vector<double> change_;
};

}  // namespace tunnel_pilot::neural
