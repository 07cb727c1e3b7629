#include "tunnel_pilot/neural/inference.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::neural {

Inference::Inference(const Network& network)
    : inputs_(network.inputs()),
      outputs_(network.outputs()),
      layers_(network.layers()),
      parameters_(network.parameters().begin(), network.parameters().end()) {
  std::size_t width = network.inputs();
  for (const Layer& layer : layers_) width = std::max(width, layer.outputs());
  front_.assign(width, 0.0F);
  back_.assign(width, 0.0F);
}

void Inference::run(const float* input, float* output) {
  std::copy_n(input, inputs_, front_.begin());
  const float* p = parameters_.data();
  for (const Layer& layer : layers_) {
    const std::size_t positions = layer.lengthOut();
    float* out = back_.data();
    for (std::size_t c = 0; c < layer.channels_out; ++c) {
      for (std::size_t at = 0; at < positions; ++at) {
        float sum = p[layer.weights() + c];
        for (std::size_t i = 0; i < layer.channels_in; ++i) {
          for (std::size_t k = 0; k < layer.kernel; ++k) {
            sum += p[(c * layer.channels_in + i) * layer.kernel + k] *
                   front_[i * layer.length_in + at * layer.stride + k];
          }
        }
        switch (layer.activation) {
          case Activation::kLinear:
            break;
          case Activation::kTanh:
            sum = std::tanh(sum);
            break;
          case Activation::kSigmoid:
            sum = 1.0F / (1.0F + std::exp(-sum));
            break;
          case Activation::kRelu:
            sum = std::max(sum, 0.0F);
            break;
        }
        *out++ = sum;
      }
    }
    std::copy_n(front_.begin() + static_cast<std::ptrdiff_t>(layer.channels_in * layer.length_in),
                layer.passed, out);
    std::swap(front_, back_);
    p += layer.parameters();
  }
  std::copy_n(front_.begin(), outputs_, output);
}

}  // namespace tunnel_pilot::neural
