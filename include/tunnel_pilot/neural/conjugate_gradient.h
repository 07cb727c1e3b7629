#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/neural/objective.h"

namespace tunnel_pilot::neural {

/// Conjugate gradients after Polak and Ribiere, with restarts (Nocedal & Wright 2006, section 5.2):
///   d = -g + beta d,  beta = max(0, g . (g - g') / g' . g'),
/// with g' the last gradient. d is -g again after as many steps as there are parameters, and whenever it
/// does not lead down. The length of a step is the minimum of the parabola through E, its slope and one
/// trial, or else is halved, until Armijo's rule holds: E falls by at least 1e-4 of what the slope
/// foretells.
///
/// Throws std::invalid_argument for a vector of another size, Diverged when E or its gradient is not
/// finite at the parameters; a trial that is not finite is only too long.
class ConjugateGradient {
 public:
  explicit ConjugateGradient(std::size_t parameters);

  /// One step; returns E behind it. Never goes up. Leaves the parameters when converged().
  double step(const Objective& objective, std::vector<double>& parameters);

  /// No step leads further down.
  bool converged() const { return converged_; }

 private:
  struct Point {
    double length = 0.0;  ///< along the direction; 0 when no step leads down
    double error = 0.0;
  };

  void turn(bool restart);
  double trial(const Objective& objective, const std::vector<double>& from, double length);
  Point search(const Objective& objective, const std::vector<double>& from, double error);

  std::vector<double> gradient_, last_gradient_, direction_, trial_;
  double slope_ = 0.0;    ///< of E along the direction, below 0
  double promise_ = 0.0;  ///< last step's length times its slope
  std::size_t since_restart_ = 0;
  bool converged_ = false;
};

}  // namespace tunnel_pilot::neural
