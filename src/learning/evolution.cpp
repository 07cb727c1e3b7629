#include "tunnel_pilot/learning/evolution.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace tunnel_pilot::learning {

Evolution::Evolution(const Eigen::VectorXd& start, double spread, std::size_t candidates,
                     std::uint64_t seed)
    : mean_(start),
      spread_(spread),
      random_(seed, simulation::Stream::kTraining),
      candidates_(candidates),
      covariance_(Eigen::MatrixXd::Identity(start.size(), start.size())),
      path_(Eigen::VectorXd::Zero(start.size())),
      spread_path_(path_) {
  if (start.size() == 0 || !(spread > 0.0) || candidates < 4) {
    throw std::invalid_argument(
        "Evolution needs parameters, a positive spread and 4 candidates or more");
  }
  const auto parents = static_cast<Eigen::Index>(candidates / 2);
  shares_.resize(parents);
  for (Eigen::Index i = 0; i < parents; ++i) {
    shares_[i] = std::log(0.5 * (static_cast<double>(candidates) + 1.0)) - std::log(i + 1.0);
  }
  shares_ /= shares_.sum();
  effective_ = 1.0 / shares_.squaredNorm();
  decompose();
}

const std::vector<Eigen::VectorXd>& Evolution::ask() {
  Eigen::VectorXd draw(mean_.size());
  for (Eigen::VectorXd& candidate : candidates_) {
    for (double& value : draw) value = random_.normal();
    candidate = mean_ + spread_ * (axes_ * lengths_.cwiseProduct(draw));
  }
  asked_ = true;
  return candidates_;
}

void Evolution::tell(const std::vector<double>& costs) {
  if (!asked_ || costs.size() != candidates_.size()) {
    throw std::invalid_argument("Evolution takes one cost for each candidate it was asked for");
  }
  const auto cost = [&](std::size_t i) {
    return std::isfinite(costs[i]) ? costs[i] : std::numeric_limits<double>::infinity();
  };
  std::vector<std::size_t> order(costs.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return cost(a) < cost(b); });
  Eigen::MatrixXd chosen(mean_.size(), shares_.size());
  for (Eigen::Index i = 0; i < shares_.size(); ++i) {
    chosen.col(i) = (candidates_[order[static_cast<std::size_t>(i)]] - mean_) / spread_;
  }
  const Eigen::VectorXd step = chosen * shares_;
  mean_ += spread_ * step;
  adapt(step, chosen);
  asked_ = false;
}

// The tutorial's equations 24 to 30 and 37, without active weights; its names: c_c, c_sigma, c_1, c_mu.
void Evolution::adapt(const Eigen::VectorXd& step, const Eigen::MatrixXd& chosen) {
  const auto n = static_cast<double>(mean_.size());
  const double path_rate = (4.0 + effective_ / n) / (n + 4.0 + 2.0 * effective_ / n);
  const double spread_rate = (effective_ + 2.0) / (n + effective_ + 5.0);
  const double one_rate = 2.0 / ((n + 1.3) * (n + 1.3) + effective_);
  const double many_rate = std::min(1.0 - one_rate, 2.0 * (effective_ - 2.0 + 1.0 / effective_) /
                                                        ((n + 2.0) * (n + 2.0) + effective_));
  const double damping =
      1.0 + 2.0 * std::max(0.0, std::sqrt((effective_ - 1.0) / (n + 1.0)) - 1.0) + spread_rate;
  const double expected = std::sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));

  generations_ += 1.0;
  const Eigen::VectorXd white = axes_ * (axes_.transpose() * step).cwiseQuotient(lengths_);
  spread_path_ = (1.0 - spread_rate) * spread_path_ +
                 std::sqrt(spread_rate * (2.0 - spread_rate) * effective_) * white;
  const double progress = spread_path_.norm() / expected;
  const double begun = std::sqrt(1.0 - std::pow(1.0 - spread_rate, 2.0 * generations_));
  const bool steady = progress / begun < 1.4 + 2.0 / (n + 1.0);
  path_ *= 1.0 - path_rate;
  if (steady) path_ += std::sqrt(path_rate * (2.0 - path_rate) * effective_) * step;
  const double kept =
      1.0 - one_rate - many_rate + (steady ? 0.0 : one_rate * path_rate * (2.0 - path_rate));
  covariance_ = (kept * covariance_ + one_rate * path_ * path_.transpose() +
                 many_rate * chosen * shares_.asDiagonal() * chosen.transpose())
                    .eval();
  spread_ *= std::exp(spread_rate / damping * (progress - 1.0));
  decompose();
}

void Evolution::decompose() {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance_);
  axes_ = solver.eigenvectors();
  lengths_ = solver.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
}

}  // namespace tunnel_pilot::learning
