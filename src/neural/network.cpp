#include "tunnel_pilot/neural/network.h"

#include <cmath>
#include <stdexcept>

namespace tunnel_pilot::neural {
namespace {

[[noreturn]] void refuse(std::size_t layer, const std::string& why) {
  throw std::invalid_argument("layer " + std::to_string(layer + 1) + " " + why);
}

// Products of sizes up to kMaxWidth do not overflow.
void check(const Layer& layer, std::size_t index) {
  for (const std::size_t size : {layer.channels_in, layer.length_in, layer.channels_out, layer.kernel,
                                 layer.stride, layer.passed + 1}) {
    if (size < 1) refuse(index, "has a size of 0");
    if (size > Network::kMaxWidth) refuse(index, "is larger than " + std::to_string(Network::kMaxWidth));
  }
  if (layer.kernel > layer.length_in) refuse(index, "has a kernel longer than its signals");
  if (layer.inputs() > Network::kMaxWidth || layer.outputs() > Network::kMaxWidth) {
    refuse(index, "is wider than " + std::to_string(Network::kMaxWidth));
  }
}

std::size_t checkedParameters(const std::vector<Layer>& layers) {
  if (layers.empty()) throw std::invalid_argument("a network needs at least one layer");
  std::size_t total = 0;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    check(layers[i], i);
    if (i > 0 && layers[i].inputs() != layers[i - 1].outputs()) {
      refuse(i, "takes " + std::to_string(layers[i].inputs()) + " values, the one before gives " +
                    std::to_string(layers[i - 1].outputs()));
    }
    // One factor after the other, lest the product overflow.
    if (layers[i].kernel * layers[i].channels_in > Network::kMaxParameters ||
        layers[i].parameters() > Network::kMaxParameters) {
      refuse(i, "has too many parameters");
    }
    total += layers[i].parameters();
    if (total > Network::kMaxParameters) {
      throw std::invalid_argument("the network has more than " +
                                  std::to_string(Network::kMaxParameters) + " parameters");
    }
  }
  return total;
}

// SplitMix64 (Steele, Lea & Flood 2014).
double uniform(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

}  // namespace

std::string toString(Activation activation) {
  switch (activation) {
    case Activation::kLinear:
      return "linear";
    case Activation::kTanh:
      return "tanh";
    case Activation::kSigmoid:
      return "sigmoid";
    case Activation::kRelu:
      return "relu";
  }
  return "?";
}

Layer Layer::dense(std::size_t inputs, std::size_t outputs, Activation activation) {
  Layer layer;
  layer.kind = Kind::kDense;
  layer.activation = activation;
  layer.length_in = inputs;
  layer.channels_out = outputs;
  layer.kernel = inputs;
  return layer;
}

Layer Layer::convolution(std::size_t channels_in, std::size_t length_in, std::size_t channels_out,
                         std::size_t kernel, std::size_t stride, std::size_t passed,
                         Activation activation) {
  return {Kind::kConvolution, activation, channels_in, length_in, channels_out, kernel, stride, passed};
}

Network::Network(std::vector<Layer> layers) : layers_(std::move(layers)) {
  parameters_.assign(checkedParameters(layers_), 0.0);
}

void Network::randomise(std::uint64_t seed) {
  std::uint64_t state = seed;
  auto parameter = parameters_.begin();
  for (const Layer& layer : layers_) {
    const double fan_in = static_cast<double>(layer.channels_in * layer.kernel);
    const double fan_out = static_cast<double>(
        layer.kind == Layer::Kind::kDense ? layer.channels_out : layer.channels_out * layer.kernel);
    const double reach = std::sqrt(6.0 / (fan_in + fan_out));
    for (std::size_t i = 0; i < layer.weights(); ++i)
      *parameter++ = reach * (2.0 * uniform(state) - 1.0);
    for (std::size_t i = 0; i < layer.channels_out; ++i) *parameter++ = 0.0;
  }
}

}  // namespace tunnel_pilot::neural
