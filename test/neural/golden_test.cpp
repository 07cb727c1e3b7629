// Against outputs and derivatives that numpy computed (make_golden.py).
#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/inference.h"

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kLanes = BatchPass::kLanes;

struct Golden {
  std::string name;
  Network network;
  std::vector<double> input, output, weights, parameter_gradient, input_gradient;
};

Layer readLayer(config::Node& node) {
  const auto size = [&](const std::string& key) {
    return static_cast<std::size_t>(node.integer(key, "1", 0, 1000));
  };
  Layer layer;
  layer.kind = node.choice("kind", {"dense", "convolution"}) == "dense" ? Layer::Kind::kDense
                                                                        : Layer::Kind::kConvolution;
  const std::string activation = node.choice("activation", {"linear", "tanh", "sigmoid", "relu"});
  for (const Activation a :
       {Activation::kLinear, Activation::kTanh, Activation::kSigmoid, Activation::kRelu}) {
    if (toString(a) == activation) layer.activation = a;
  }
  layer.channels_in = size("channels_in");
  layer.length_in = size("length_in");
  layer.channels_out = size("channels_out");
  layer.kernel = size("kernel");
  layer.stride = size("stride");
  layer.passed = size("passed");
  node.finish();
  return layer;
}

std::vector<Golden> readGolden() {
  config::Node file =
      config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/test/neural/golden.yaml");
  std::vector<Golden> all;
  for (config::Node& node : file.children("networks")) {
    std::vector<Layer> layers;
    for (config::Node& layer : node.children("layers")) layers.push_back(readLayer(layer));
    const auto numbers = [&](const std::string& key, std::size_t count) {
      return node.numbers(key, "1", -1e3, 1e3, count, count);
    };
    Golden golden{node.text("name"), Network(layers), {}, {}, {}, {}, {}};
    golden.network.parameters() = numbers("parameters", golden.network.parameters().size());
    golden.input = numbers("input", golden.network.inputs());
    golden.output = numbers("output", golden.network.outputs());
    golden.weights = numbers("weights", golden.network.outputs());
    golden.parameter_gradient = numbers("parameter_gradient", golden.network.parameters().size());
    golden.input_gradient = numbers("input_gradient", golden.network.inputs());
    node.finish();
    all.push_back(std::move(golden));
  }
  return all;
}

// The sample stands in one lane, and nothing in the others.
TEST(Golden, BatchPassGivesNumpysOutputsAndDerivatives) {
  const std::vector<Golden> all = readGolden();
  ASSERT_EQ(all.size(), 10u);
  std::size_t lane = 0;
  for (const Golden& golden : all) {
    BatchPass pass(golden.network);
    for (std::size_t i = 0; i < golden.input.size(); ++i) pass.input(i)[lane] = golden.input[i];
    pass.forward();
    for (std::size_t o = 0; o < golden.output.size(); ++o) {
      EXPECT_NEAR(pass.output(o)[lane], golden.output[o], 1e-13) << golden.name << " " << o;
      std::fill_n(pass.outputGradient(o), kLanes, 0.0);
      pass.outputGradient(o)[lane] = golden.weights[o];
    }
    std::vector<double> gradient(golden.parameter_gradient.size());
    pass.backward(gradient, true);
    for (std::size_t i = 0; i < gradient.size(); ++i) {
      EXPECT_NEAR(gradient[i], golden.parameter_gradient[i], 1e-13) << golden.name << " " << i;
    }
    for (std::size_t i = 0; i < golden.input.size(); ++i) {
      EXPECT_NEAR(pass.inputGradient(i)[lane], golden.input_gradient[i], 1e-13)
          << golden.name << " " << i;
    }
    lane = (lane + 13) % kLanes;
  }
}

TEST(Golden, InferenceGivesNumpysOutputs) {
  for (const Golden& golden : readGolden()) {
    Inference inference(golden.network);
    const std::vector<float> input(golden.input.begin(), golden.input.end());
    std::vector<float> output(golden.output.size());
    inference.run(input.data(), output.data());
    for (std::size_t o = 0; o < output.size(); ++o) {
      EXPECT_NEAR(static_cast<double>(output[o]), golden.output[o],
                  1e-6 * std::max(1.0, std::abs(golden.output[o])))
          << golden.name << " " << o;
    }
  }
}

}  // namespace
}  // namespace tunnel_pilot::neural
