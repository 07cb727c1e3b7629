#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {

/// Finds parameters of least cost without derivatives: evolution strategy with covariance matrix
/// adaptation (CMA-ES; Hansen 2016, "The CMA Evolution Strategy: A Tutorial", with its default
/// constants). For tens of parameters and costs that are noisy or have kinks, such as those of a closed
/// loop. Ask for candidates, tell their costs, repeat. Deterministic for a seed.
class Evolution {
 public:
  /// `spread` is the standard deviation that the first candidates have in every parameter. Throws
  /// std::invalid_argument without parameters, for a spread that is not positive and for fewer than 4
  /// candidates.
  Evolution(const Eigen::VectorXd& start, double spread, std::size_t candidates, std::uint64_t seed);

  const std::vector<Eigen::VectorXd>& ask();
  /// `costs`: one for each candidate; what is not finite counts as worst. Throws std::invalid_argument
  /// for another number of costs and before the first ask().
  void tell(const std::vector<double>& costs);

  const Eigen::VectorXd& mean() const { return mean_; }
  double spread() const { return spread_; }

 private:
  void adapt(const Eigen::VectorXd& step, const Eigen::MatrixXd& chosen);
  void decompose();

  Eigen::VectorXd mean_;
  double spread_;
  simulation::Random random_;
  std::vector<Eigen::VectorXd> candidates_;
  bool asked_ = false;
  Eigen::VectorXd shares_;  ///< weights of the best candidates in the new mean
  double effective_;        ///< variance effective number of them
  Eigen::MatrixXd covariance_, axes_;
  Eigen::VectorXd lengths_;             ///< of the axes
  Eigen::VectorXd path_, spread_path_;  ///< evolution paths of covariance and spread
  double generations_ = 0.0;
};

}  // namespace tunnel_pilot::learning
