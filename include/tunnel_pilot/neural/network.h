#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tunnel_pilot::neural {

enum class Activation : std::uint8_t { kLinear, kTanh, kSigmoid, kRelu };

std::string toString(Activation activation);

/// One layer of a network, y = activation(W x + b).
///
/// Dense: W is full, channels_in = channels_out = 1 and kernel = length_in.
/// Convolution: the first channels_in * length_in inputs are signals, channel after channel; each output
/// channel is the sum of all signals, each weighted with a kernel of its own that moves on by `stride`
/// (no padding: length_out = (length_in - kernel) / stride + 1). The last `passed` inputs are handed on
/// behind the outputs unchanged, so that single values reach the dense layers behind.
struct Layer {
  enum class Kind : std::uint8_t { kDense, kConvolution };
  Kind kind = Kind::kDense;
  Activation activation = Activation::kLinear;
  std::size_t channels_in = 1;
  std::size_t length_in = 0;
  std::size_t channels_out = 1;  ///< of a dense layer: its outputs
  std::size_t kernel = 0;
  std::size_t stride = 1;
  std::size_t passed = 0;

  static Layer dense(std::size_t inputs, std::size_t outputs, Activation activation);
  static Layer convolution(std::size_t channels_in, std::size_t length_in, std::size_t channels_out,
                           std::size_t kernel, std::size_t stride, std::size_t passed,
                           Activation activation);

  std::size_t lengthOut() const { return (length_in - kernel) / stride + 1; }
  std::size_t inputs() const { return channels_in * length_in + passed; }
  std::size_t outputs() const { return channels_out * lengthOut() + passed; }
  std::size_t weights() const { return channels_out * channels_in * kernel; }
  std::size_t parameters() const { return weights() + channels_out; }
};

/// A feed-forward network of dense and convolution layers with its parameters. Parameters lie layer
/// after layer: weights [output channel][input channel][kernel], then one bias an output channel.
/// Throws std::invalid_argument when a layer's sizes are impossible or do not suit its neighbour's, and
/// for more than kMaxParameters, before anything is allocated.
class Network {
 public:
  static constexpr std::size_t kMaxParameters = 4'000'000;
  static constexpr std::size_t kMaxWidth = 100'000;  ///< inputs or outputs of a layer

  explicit Network(std::vector<Layer> layers);

  const std::vector<Layer>& layers() const { return layers_; }
  std::size_t inputs() const { return layers_.front().inputs(); }
  std::size_t outputs() const { return layers_.back().outputs(); }

  std::vector<double>& parameters() { return parameters_; }
  const std::vector<double>& parameters() const { return parameters_; }

  /// Weights uniform in +-sqrt(6 / (fan_in + fan_out)) (Glorot & Bengio 2010), biases zero; the same on
  /// every platform.
  void randomise(std::uint64_t seed);

 private:
  std::vector<Layer> layers_;
  std::vector<double> parameters_;
};

}  // namespace tunnel_pilot::neural
