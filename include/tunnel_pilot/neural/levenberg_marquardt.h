#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/neural/objective.h"

namespace tunnel_pilot::neural {

struct LevenbergMarquardtParameters {
  double mu = 1e-3;        ///< damping at the start, above 0
  double decrease = 0.1;   ///< of mu after a step that leads down, in (0, 1)
  double increase = 10.0;  ///< of mu after one that does not, above 1
  double mu_max = 1e10;    ///< no step leads down when mu would grow beyond
};

/// Levenberg-Marquardt (Hagan & Menhaj 1994): makes the sum of squares of errors e = target - output
/// small,
///   dp = (J' J + mu I)^-1 J' e,  J = d output / d parameter,
/// with mu times `increase` until the sum falls, and times `decrease` then. For networks of some hundred
/// parameters at most: the matrix has as many rows and columns. Stop it with EarlyStopping.
///
/// Throws std::invalid_argument for settings out of range, Diverged when errors or Jacobian are not
/// finite at the parameters; a trial that is not finite only raises mu.
class LevenbergMarquardt {
 public:
  explicit LevenbergMarquardt(const LevenbergMarquardtParameters& settings);

  /// One step; returns the sum of squares behind it. Never goes up. Leaves the parameters when
  /// converged().
  double step(const Residuals& residuals, std::vector<double>& parameters);

  /// No step leads further down.
  bool converged() const { return converged_; }
  double mu() const { return mu_; }

 private:
  LevenbergMarquardtParameters settings_;
  double mu_;
  bool converged_ = false;
  std::vector<double> errors_, jacobian_, trial_;
};

}  // namespace tunnel_pilot::neural
