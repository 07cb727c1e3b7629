#include "tunnel_pilot/neural/levenberg_marquardt.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "tunnel_pilot/neural/diverged.h"

namespace tunnel_pilot::neural {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

double sumOfSquares(const std::vector<double>& values) {
  return std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
}

}  // namespace

LevenbergMarquardt::LevenbergMarquardt(const LevenbergMarquardtParameters& settings)
    : settings_(settings), mu_(settings.mu) {
  if (!(settings.mu > 0.0) || !(settings.mu <= settings.mu_max) || !std::isfinite(settings.mu_max)) {
    throw std::invalid_argument("mu must be positive and not above its maximum");
  }
  if (!(settings.decrease > 0.0 && settings.decrease < 1.0) || !(settings.increase > 1.0) ||
      !std::isfinite(settings.increase)) {
    throw std::invalid_argument("mu must fall by a factor within (0, 1) and rise by one above 1");
  }
}

double LevenbergMarquardt::step(const Residuals& residuals, std::vector<double>& parameters) {
  requireFinite(parameters, "parameter");
  residuals(parameters, errors_, &jacobian_);
  requireFinite(errors_, "error");
  requireFinite(jacobian_, "derivative");
  const auto rows = static_cast<Eigen::Index>(errors_.size());
  const auto columns = static_cast<Eigen::Index>(parameters.size());
  const Eigen::Map<const Rows> j(jacobian_.data(), rows, columns);
  const Eigen::VectorXd downhill =
      j.transpose() * Eigen::Map<const Eigen::VectorXd>(errors_.data(), rows);
  const Eigen::MatrixXd square = j.transpose() * j;
  const double before = sumOfSquares(errors_);
  for (; mu_ <= settings_.mu_max; mu_ *= settings_.increase) {
    Eigen::MatrixXd damped = square;
    damped.diagonal().array() += mu_;
    const Eigen::VectorXd change = damped.ldlt().solve(downhill);
    trial_ = parameters;
    for (std::size_t i = 0; i < trial_.size(); ++i) trial_[i] += change[static_cast<Eigen::Index>(i)];
    residuals(trial_, errors_, nullptr);
    const double sum = sumOfSquares(errors_);
    if (!(sum < before)) continue;  // nor for what is not a number
    mu_ = std::max(mu_ * settings_.decrease, 1e-20);
    parameters = trial_;
    converged_ = false;
    return sum;
  }
  mu_ = settings_.mu_max;
  converged_ = true;
  return before;
}

}  // namespace tunnel_pilot::neural
