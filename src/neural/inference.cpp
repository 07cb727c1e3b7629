#include "tunnel_pilot/neural/inference.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::neural {

Inference::Inference(const Network& network)
    : network_(network), parameters_(network.parameters().begin(), network.parameters().end()),
      inputs_(network.inputs()), outputs_(network.outputs()) {
  for (const Layer& layer : network.layers()) values_.emplace_back(layer.outputs());
}

void Inference::run(const float* input, float* output) {
  const float* x = input;
  const float* p = parameters_.data();
  for (std::size_t n = 0; n < values_.size(); ++n) {
    const Layer& l = network_.layers()[n];
    float* y = values_[n].data();
    const std::size_t positions = l.lengthOut();
    for (std::size_t c = 0; c < l.channels_out; ++c)
      for (std::size_t q = 0; q < positions; ++q) {
        float part[8] = {};
        float sum = p[l.weights() + c];
        for (std::size_t i = 0; i < l.channels_in; ++i) {
          const float* w = p + (c * l.channels_in + i) * l.kernel;
          const float* v = x + i * l.length_in + q * l.stride;
          std::size_t k = 0;
          for (; k + 8 <= l.kernel; k += 8)
            for (std::size_t j = 0; j < 8; ++j) part[j] += w[k + j] * v[k + j];
          for (; k < l.kernel; ++k) sum += w[k] * v[k];
        }
        for (const float v : part) sum += v;
        switch (l.activation) {
          case Activation::kTanh: sum = std::tanh(sum); break;
          case Activation::kSigmoid: sum = 1.0F / (1.0F + std::exp(-sum)); break;
          case Activation::kRelu: sum = std::max(sum, 0.0F); break;
          case Activation::kLinear: break;
        }
        y[c * positions + q] = sum;
      }
    std::copy_n(x + l.channels_in * l.length_in, l.passed, y + l.channels_out * positions);
    x = y;
    p += l.parameters();
  }
  std::copy_n(x, outputs_, output);
}

}  // namespace tunnel_pilot::neural
