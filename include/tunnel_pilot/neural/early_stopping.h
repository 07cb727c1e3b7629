#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace tunnel_pilot::neural {

/// Stops a training when the error on samples held out has not fallen for `patience` epochs one after
/// the other, and keeps the parameters of the best epoch (Prechelt 1998). Epochs count from 0, the first
/// that is told.
class EarlyStopping {
 public:
  explicit EarlyStopping(std::size_t patience) : patience_(patience) {}

  /// True when training should stop. Throws Diverged for an error that is not finite.
  bool stop(double validation_error, const std::vector<double>& parameters);

  double bestError() const { return best_error_; }
  std::size_t bestEpoch() const { return best_epoch_; }
  std::size_t epochs() const { return epochs_; }  ///< told so far
  const std::vector<double>& bestParameters() const { return best_; }

 private:
  std::size_t patience_;
  std::size_t epochs_ = 0;
  std::size_t best_epoch_ = 0;
  double best_error_ = std::numeric_limits<double>::infinity();
  std::vector<double> best_;
};

}  // namespace tunnel_pilot::neural
