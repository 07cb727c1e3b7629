#include "tunnel_pilot/neural/conjugate_gradient.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "tunnel_pilot/neural/diverged.h"

namespace tunnel_pilot::neural {
namespace {

constexpr double kArmijo = 1e-4;
constexpr double kLeastCosine = 1e-6;  // between the direction and the way straight down
constexpr double kMostStretch = 10.0;  // of a trial to the parabola's minimum, either way
constexpr int kHalvings = 60;

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

ConjugateGradient::ConjugateGradient(std::size_t parameters)
    : gradient_(parameters), last_gradient_(parameters), direction_(parameters), trial_(parameters) {}

double ConjugateGradient::step(const Objective& objective, std::vector<double>& parameters) {
  if (parameters.size() != direction_.size()) {
    throw std::invalid_argument("conjugate gradients were made for another number of parameters");
  }
  const double error = objective(parameters, &gradient_);
  if (!std::isfinite(error)) throw Diverged("training diverged: the error is " + std::to_string(error));
  requireFinite(gradient_, "gradient");
  converged_ = false;
  turn(since_restart_ == 0 || since_restart_ >= parameters.size());
  Point best = search(objective, parameters, error);
  if (best.length == 0.0 && since_restart_ > 1) {
    turn(true);
    best = search(objective, parameters, error);
  }
  converged_ = best.length == 0.0;
  if (converged_) return error;
  for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i] += best.length * direction_[i];
  last_gradient_ = gradient_;
  promise_ = best.length * slope_;
  return best.error;
}

// The next direction, and the slope along it.
void ConjugateGradient::turn(bool restart) {
  const double square = dot(gradient_, gradient_);
  double beta = 0.0;
  if (!restart) {
    beta =
        std::max(0.0, (square - dot(gradient_, last_gradient_)) / dot(last_gradient_, last_gradient_));
  }
  for (std::size_t i = 0; i < direction_.size(); ++i) {
    direction_[i] = beta * direction_[i] - gradient_[i];
  }
  slope_ = dot(gradient_, direction_);
  since_restart_ = beta == 0.0 ? 1 : since_restart_ + 1;
  if (beta > 0.0 && !(slope_ < -kLeastCosine * std::sqrt(square * dot(direction_, direction_))))
    turn(true);
}

// E a step of this length away.
double ConjugateGradient::trial(const Objective& objective, const std::vector<double>& from,
                                double length) {
  for (std::size_t i = 0; i < from.size(); ++i) trial_[i] = from[i] + length * direction_[i];
  return objective(trial_, nullptr);
}

ConjugateGradient::Point ConjugateGradient::search(const Objective& objective,
                                                   const std::vector<double>& from, double error) {
  if (!(slope_ < 0.0)) return {};
  const auto enough = [&](const Point& p) { return p.error <= error + kArmijo * p.length * slope_; };
  // The first trial promises to gain what the last step promised; the very first goes one unit.
  const double start = promise_ < 0.0 ? promise_ / slope_ : 1.0 / std::sqrt(dot(direction_, direction_));
  Point first{start, trial(objective, from, start)};
  const double bend = first.error - error - start * slope_;
  double minimum = bend > 0.0 ? -0.5 * slope_ * start * start / bend : kMostStretch * start;
  if (!std::isfinite(first.error)) minimum = 0.0;
  minimum = std::clamp(minimum, start / kMostStretch, start * kMostStretch);
  Point second{minimum, trial(objective, from, minimum)};
  if (enough(second) && !(first.error < second.error)) return second;
  if (enough(first)) return first;
  if (enough(second)) return second;
  Point shorter{std::min(start, minimum), 0.0};
  for (int i = 0; i < kHalvings; ++i) {
    shorter.length *= 0.5;
    shorter.error = trial(objective, from, shorter.length);
    if (shorter.error < error && enough(shorter)) return shorter;
  }
  return {};
}

}  // namespace tunnel_pilot::neural
