#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural {

/// Forward and backward pass of kLanes samples side by side: row r of a layer holds its r-th value of
/// every sample. All sums run in an order that the source fixes, so that results are the same with every
/// vector width. Double precision: for training, and as the reference for Inference.
///
/// Use: fill input(), forward(), read output(), fill outputGradient() with dE/dy (zero in lanes that
/// hold no sample), backward(), which adds dE/dp of all lanes. Allocates nothing after construction. The
/// network must outlive it and keep its layers; its parameters may change between passes.
class BatchPass {
 public:
  static constexpr std::size_t kLanes = 32;

  explicit BatchPass(const Network& network);

  double* input(std::size_t row) { return values_.front().data() + row * kLanes; }
  const double* output(std::size_t row) const { return values_.back().data() + row * kLanes; }
  double* outputGradient(std::size_t row) { return gradients_.back().data() + row * kLanes; }
  /// dE/dx of the input, after a backward() with it wanted.
  const double* inputGradient(std::size_t row) const { return gradients_.front().data() + row * kLanes; }

  void forward();
  /// Adds to `parameter_gradient` (as many values as the network has parameters).
  void backward(std::vector<double>& parameter_gradient, bool want_input_gradient = false);

 private:
  const Network* network_;
  std::vector<std::vector<double>> values_;     ///< input, then each layer's output
  std::vector<std::vector<double>> gradients_;  ///< dE/d of the same
  std::vector<double> transposed_;              ///< a layer's input, lane after lane
};

}  // namespace tunnel_pilot::neural
