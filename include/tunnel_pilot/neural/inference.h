#pragma once

#include <cstddef>
#include <vector>

#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural {

/// Fast forward pass of one input, in single precision, within 1e-6 of the double-precision BatchPass
/// for outputs of magnitude 1. Keeps a copy of the parameters, laid out for vector instructions.
/// Allocates nothing after construction. Sums run in an order that the source fixes, so that results are
/// the same with every vector width.
class Inference {
 public:
  explicit Inference(const Network& network);

  std::size_t inputs() const { return inputs_; }
  std::size_t outputs() const { return outputs_; }

  /// `input` holds inputs() values, `output` has room for outputs().
  void run(const float* input, float* output);

 private:
  std::size_t inputs_, outputs_;
  std::vector<Layer> layers_;
  std::vector<float> parameters_;
  std::vector<float> front_, back_;
};

}  // namespace tunnel_pilot::neural
