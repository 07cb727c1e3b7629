#include "tunnel_pilot/neural/early_stopping.h"

#include <cmath>
#include <string>

#include "tunnel_pilot/neural/diverged.h"

namespace tunnel_pilot::neural {

bool EarlyStopping::stop(double validation_error, const std::vector<double>& parameters) {
  if (!std::isfinite(validation_error)) {
    throw Diverged("training diverged: the validation error is " + std::to_string(validation_error));
  }
  if (validation_error < best_error_) {
    best_error_ = validation_error;
    best_epoch_ = epochs_;
    best_ = parameters;
  }
  ++epochs_;
  return epochs_ - 1 - best_epoch_ >= patience_;
}

}  // namespace tunnel_pilot::neural
