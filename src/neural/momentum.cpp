#include "tunnel_pilot/neural/momentum.h"

#include <cmath>
#include <stdexcept>

#include "tunnel_pilot/neural/diverged.h"

namespace tunnel_pilot::neural {

Momentum::Momentum(std::size_t parameters, const MomentumParameters& settings)
    : settings_(settings), change_(parameters, 0.0) {
  if (!std::isfinite(settings.rate) || settings.rate < 0.0) {
    throw std::invalid_argument("the rate must not be negative");
  }
  if (!(settings.momentum >= 0.0 && settings.momentum < 1.0)) {
    throw std::invalid_argument("the momentum must be within [0, 1)");
  }
}

void Momentum::step(std::vector<double>& parameters, const std::vector<double>& gradient,
                    double rate_factor) {
  if (parameters.size() != change_.size() || gradient.size() != change_.size()) {
    throw std::invalid_argument("momentum was made for another number of parameters");
  }
  requireFinite(gradient, "gradient");
  requireFinite(parameters, "parameter");
  for (std::size_t i = 0; i < change_.size(); ++i) {
    change_[i] = settings_.momentum * change_[i] - settings_.rate * rate_factor * gradient[i];
    parameters[i] += change_[i];
  }
}

}  // namespace tunnel_pilot::neural
