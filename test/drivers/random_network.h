#pragma once

#include <cstddef>
#include <cstdint>

#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::drivers {

/// A lidar driver's network with weights that nobody trained, but for a bell in the middle of its
/// outputs' biases, so that its outputs can be decoded.
inline neural::NetworkFile randomNetwork(std::uint64_t seed = 1) {
  using neural::InputGroup;
  using neural::Layer;
  constexpr std::size_t kOutputs = 31;
  neural::Network network({Layer::dense(762, 5, neural::Activation::kTanh),
                           Layer::dense(5, kOutputs, neural::Activation::kLinear)});
  network.randomise(seed);
  constexpr double kFirst = -0.75;
  constexpr double kSpacing = 0.05;
  constexpr double kWidth = 10.0;
  std::vector<double>& p = network.parameters();
  const std::size_t first_layer = network.layers().front().parameters();
  for (std::size_t i = first_layer; i < p.size(); ++i) p[i] *= 0.3;
  const neural::GaussianCode code(kOutputs, kFirst, kSpacing, kWidth);
  code.encode(0.02, &p[p.size() - kOutputs]);
  std::vector<InputGroup> inputs = {
      {"ranges", "m", 761, InputGroup::Transform::kInverse, 0.0, 2.0, 0.5, 40.0},
      {"articulation", "rad", 1, InputGroup::Transform::kLinear, 0.0, 0.75, -0.8, 0.8}};
  neural::OutputGroup output{"articulation_angle",
                             "rad",
                             neural::OutputGroup::Code::kGaussian,
                             0.0,
                             1.0,
                             kFirst,
                             kSpacing,
                             kWidth};
  return {"random", network, inputs, output, "none: random weights of a test", ""};
}

}  // namespace tunnel_pilot::drivers
