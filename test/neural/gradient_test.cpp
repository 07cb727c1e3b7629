// Gradients and Jacobians against finite differences, for all kinds of layers.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <stdexcept>

#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/objective.h"

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kLanes = BatchPass::kLanes;
constexpr double kStep = 1e-6;

struct Case {
  const char* name;
  std::vector<Layer> layers;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const Activation a :
       {Activation::kLinear, Activation::kTanh, Activation::kSigmoid, Activation::kRelu}) {
    all.push_back({"dense", {Layer::dense(6, 5, a), Layer::dense(5, 3, a)}});
    all.push_back({"convolution",
                   {Layer::convolution(2, 11, 3, 4, 2, 2, a), Layer::convolution(3, 4, 2, 3, 1, 2, a),
                    Layer::dense(6, 2, a)}});
    all.push_back({"strided past the end", {Layer::convolution(1, 9, 2, 3, 4, 0, a)}});
  }
  return all;
}

Network randomNetwork(const std::vector<Layer>& layers, std::mt19937_64& random) {
  Network network(layers);
  std::uniform_real_distribution<double> draw(-1.0, 1.0);
  for (double& p : network.parameters()) p = draw(random);
  return network;
}

Samples randomSamples(const Network& network, std::size_t count, std::mt19937_64& random) {
  std::uniform_real_distribution<double> draw(-1.0, 1.0);
  Samples samples;
  samples.inputs.resize(count * network.inputs());
  samples.targets.resize(count * network.outputs());
  for (double& x : samples.inputs) x = draw(random);
  for (double& t : samples.targets) t = 0.5 + 0.4 * draw(random);
  return samples;
}

void expectGradient(const Objective& objective, std::vector<double> p, const std::string& name) {
  std::vector<double> gradient;
  objective(p, &gradient);
  ASSERT_EQ(gradient.size(), p.size());
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double at = p[i];
    p[i] = at + kStep;
    const double more = objective(p, nullptr);
    p[i] = at - kStep;
    const double less = objective(p, nullptr);
    p[i] = at;
    const double slope = (more - less) / (2.0 * kStep);
    ASSERT_NEAR(gradient[i], slope, 1e-8 + 1e-6 * std::abs(slope)) << name << " " << i;
  }
}

TEST(Gradient, ParametersAgreeWithFiniteDifferencesForAllLayersAndActivations) {
  std::mt19937_64 random(1);
  for (const Case& c : cases()) {
    Network network = randomNetwork(c.layers, random);
    const Samples samples = randomSamples(network, 50, random);  // one batch and a part of one
    NetworkObjective objective(network, samples, halfSquaredError);
    const std::vector<double> p = network.parameters();
    expectGradient(std::ref(objective), p, c.name);
  }
}

TEST(Gradient, CrossEntropyOfSigmoidOutputsAgreesWithFiniteDifferences) {
  std::mt19937_64 random(2);
  Network network = randomNetwork(
      {Layer::dense(6, 5, Activation::kTanh), Layer::dense(5, 4, Activation::kSigmoid)}, random);
  const Samples samples = randomSamples(network, 40, random);
  NetworkObjective objective(network, samples, crossEntropy);
  const std::vector<double> p = network.parameters();
  expectGradient(std::ref(objective), p, "cross-entropy");
}

// The figure was made once with SSE2, with AVX2 and without optimisation. Nothing here calls the
// mathematical library, which may differ.
TEST(Gradient, BitsAreTheSameOnEveryMachine) {
  std::mt19937_64 random(6);
  const auto draw = [&] { return static_cast<double>(random() >> 11U) * 0x1p-53 - 0.5; };
  Network network({Layer::convolution(2, 31, 7, 9, 2, 1, Activation::kRelu),
                   Layer::convolution(7, 12, 5, 5, 1, 1, Activation::kRelu),
                   Layer::dense(41, 9, Activation::kRelu), Layer::dense(9, 3, Activation::kLinear)});
  for (double& p : network.parameters()) p = draw();
  BatchPass pass(network);
  for (std::size_t i = 0; i < network.inputs(); ++i) {
    for (std::size_t l = 0; l < kLanes; ++l) pass.input(i)[l] = draw();
  }
  pass.forward();
  for (std::size_t o = 0; o < network.outputs(); ++o) {
    for (std::size_t l = 0; l < kLanes; ++l) pass.outputGradient(o)[l] = pass.output(o)[l] - 0.1;
  }
  std::vector<double> gradient(network.parameters().size());
  pass.backward(gradient, true);
  std::uint64_t sum = 0;
  const auto add = [&](double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    sum = 31 * sum + bits;
  };
  for (const double g : gradient) add(g);
  for (std::size_t i = 0; i < network.inputs(); ++i) add(pass.inputGradient(i)[i % kLanes]);
  EXPECT_EQ(sum, 280192781432671679U);
}

// The sum of all outputs of all lanes.
double total(BatchPass& pass, const Network& network) {
  pass.forward();
  double sum = 0.0;
  for (std::size_t o = 0; o < network.outputs(); ++o) {
    for (std::size_t l = 0; l < kLanes; ++l) sum += pass.output(o)[l];
  }
  return sum;
}

TEST(Gradient, InputsAgreeWithFiniteDifferences) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> draw(-1.0, 1.0);
  for (const Case& c : cases()) {
    const Network network = randomNetwork(c.layers, random);
    BatchPass pass(network);
    for (std::size_t i = 0; i < network.inputs(); ++i) {
      for (std::size_t l = 0; l < kLanes; ++l) pass.input(i)[l] = draw(random);
    }
    total(pass, network);
    for (std::size_t o = 0; o < network.outputs(); ++o) std::fill_n(pass.outputGradient(o), kLanes, 1.0);
    std::vector<double> unused(network.parameters().size());
    pass.backward(unused, true);
    for (std::size_t i = 0; i < network.inputs(); ++i) {
      const std::size_t lane = (7 * i) % kLanes;
      double& x = pass.input(i)[lane];
      const double at = x;
      x = at + kStep;
      const double more = total(pass, network);
      x = at - kStep;
      const double less = total(pass, network);
      x = at;
      ASSERT_NEAR(pass.inputGradient(i)[lane], (more - less) / (2.0 * kStep), 1e-7)
          << c.name << " " << i;
    }
  }
}

TEST(Jacobian, AgreesWithFiniteDifferencesForAllLayersAndActivations) {
  std::mt19937_64 random(4);
  for (const Case& c : cases()) {
    Network network = randomNetwork(c.layers, random);
    const Samples samples = randomSamples(network, 35, random);
    NetworkResiduals residuals(network, samples);
    std::vector<double> p = network.parameters();
    std::vector<double> errors;
    std::vector<double> more;
    std::vector<double> less;
    std::vector<double> jacobian;
    residuals(p, errors, &jacobian);
    ASSERT_EQ(errors.size(), 35 * network.outputs());
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double at = p[i];
      p[i] = at + kStep;
      residuals(p, more, nullptr);
      p[i] = at - kStep;
      residuals(p, less, nullptr);
      p[i] = at;
      for (std::size_t r = 0; r < errors.size(); ++r) {
        // Errors are target minus output: their slope is minus the output's.
        const double slope = (less[r] - more[r]) / (2.0 * kStep);
        ASSERT_NEAR(jacobian[r * p.size() + i], slope, 1e-7) << c.name << " " << r << " " << i;
      }
    }
  }
}

TEST(Jacobian, ErrorsAreTargetsMinusOutputs) {
  Network network({Layer::dense(1, 2, Activation::kLinear)});
  const Samples samples{{3.0, -1.0}, {10.0, 20.0, 30.0, 40.0}};
  NetworkResiduals residuals(network, samples);
  std::vector<double> errors;
  residuals({2.0, -1.0, 0.5, 0.25}, errors, nullptr);  // y1 = 2x + 0.5, y2 = -x + 0.25
  EXPECT_EQ(errors, (std::vector<double>{10.0 - 6.5, 20.0 + 2.75, 30.0 + 1.5, 40.0 - 1.25}));
}

TEST(Objective, IsTheMeanOverSamplesWhateverTheirNumber) {
  std::mt19937_64 random(5);
  Network network = randomNetwork({Layer::dense(3, 2, Activation::kTanh)}, random);
  const std::vector<double> p = network.parameters();
  Samples once = randomSamples(network, 33, random);
  Samples twice = once;
  twice.inputs.insert(twice.inputs.end(), once.inputs.begin(), once.inputs.end());
  twice.targets.insert(twice.targets.end(), once.targets.begin(), once.targets.end());
  EXPECT_NEAR(NetworkObjective(network, once, halfSquaredError)(p, nullptr),
              NetworkObjective(network, twice, halfSquaredError)(p, nullptr), 1e-15);
}

TEST(Objective, RefusesSamplesAndParametersOfOtherSizes) {
  Network network({Layer::dense(2, 1, Activation::kTanh)});
  EXPECT_THROW(NetworkObjective(network, Samples{}, halfSquaredError), std::invalid_argument);
  const Samples odd{{1.0, 2.0, 3.0}, {1.0}};
  EXPECT_THROW(NetworkObjective(network, odd, halfSquaredError), std::invalid_argument);
  EXPECT_THROW(NetworkResiduals(network, odd), std::invalid_argument);
  const Samples good{{1.0, 2.0}, {1.0}};
  NetworkObjective objective(network, good, halfSquaredError);
  EXPECT_THROW(objective({1.0}, nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace tunnel_pilot::neural
