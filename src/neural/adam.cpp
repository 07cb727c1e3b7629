#include "tunnel_pilot/neural/adam.h"

#include <cmath>
#include <stdexcept>

#include "tunnel_pilot/neural/diverged.h"

namespace tunnel_pilot::neural {
namespace {

void check(const AdamParameters& s) {
  const auto inUnit = [](double beta) { return beta >= 0.0 && beta < 1.0; };
  const auto notNegative = [](double value) { return std::isfinite(value) && value >= 0.0; };
  if (!notNegative(s.rate)) throw std::invalid_argument("Adam's rate must not be negative");
  if (!inUnit(s.beta1) || !inUnit(s.beta2)) {
    throw std::invalid_argument("Adam's decays must be within [0, 1)");
  }
  if (!notNegative(s.epsilon) || s.epsilon == 0.0) {
    throw std::invalid_argument("Adam's epsilon must be positive");
  }
  if (!notNegative(s.weight_decay)) throw std::invalid_argument("weight decay must not be negative");
}

}  // namespace

Adam::Adam(std::size_t parameters, const AdamParameters& settings)
    : settings_(settings), mean_(parameters, 0.0), mean_square_(parameters, 0.0) {
  check(settings);
}

void Adam::step(std::vector<double>& parameters, const std::vector<double>& gradient,
                double rate_factor) {
  if (parameters.size() != mean_.size() || gradient.size() != mean_.size()) {
    throw std::invalid_argument("Adam was made for another number of parameters");
  }
  requireFinite(gradient, "gradient");
  requireFinite(parameters, "parameter");
  power1_ *= settings_.beta1;
  power2_ *= settings_.beta2;
  const double rate = settings_.rate * rate_factor;
  const double scale1 = 1.0 / (1.0 - power1_);
  const double scale2 = 1.0 / (1.0 - power2_);
  for (std::size_t i = 0; i < mean_.size(); ++i) {
    mean_[i] += (1.0 - settings_.beta1) * (gradient[i] - mean_[i]);
    mean_square_[i] += (1.0 - settings_.beta2) * (gradient[i] * gradient[i] - mean_square_[i]);
    const double way = mean_[i] * scale1 / (std::sqrt(mean_square_[i] * scale2) + settings_.epsilon);
    parameters[i] -= rate * (way + settings_.weight_decay * parameters[i]);
  }
}

}  // namespace tunnel_pilot::neural
