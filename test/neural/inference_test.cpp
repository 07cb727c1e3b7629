#include "tunnel_pilot/neural/inference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "tunnel_pilot/neural/batch_pass.h"

namespace tunnel_pilot::neural {

struct InferenceAccess {
  static std::size_t kernels() { return Inference::kernels().size(); }
  static Inference withKernel(std::size_t i, const Network& network) {
    Inference inference(network);
    inference.kernel_ = Inference::kernels()[i];
    return inference;
  }
};

namespace {

constexpr Activation kActivations[] = {Activation::kLinear, Activation::kTanh, Activation::kSigmoid,
                                       Activation::kRelu};

std::vector<float> randomInput(std::size_t count, std::mt19937_64& random) {
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  std::vector<float> input(count);
  for (float& x : input) x = draw(random);
  return input;
}

// The largest error against the double-precision pass, relative for outputs above 1.
double errorOf(const Network& network, const std::vector<float>& input) {
  Inference inference(network);
  std::vector<float> output(network.outputs());
  inference.run(input.data(), output.data());
  BatchPass pass(network);
  for (std::size_t i = 0; i < input.size(); ++i) pass.input(i)[0] = static_cast<double>(input[i]);
  pass.forward();
  double largest = 0.0;
  for (std::size_t i = 0; i < output.size(); ++i) {
    const double exact = pass.output(i)[0];
    const double error = std::abs(static_cast<double>(output[i]) - exact);
    if (!(error >= 0.0)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, error / std::max(1.0, std::abs(exact)));
  }
  return largest;
}

// With biases that are not zero, as after training. Parameters are floats, so that only the arithmetic
// differs.
void randomise(Network& network, std::mt19937_64& random) {
  network.randomise(random());
  std::uniform_real_distribution<double> bias(-0.3, 0.3);
  for (double& p : network.parameters()) {
    p = static_cast<double>(static_cast<float>(p == 0.0 ? bias(random) : p));
  }
}

Network randomNetwork(std::mt19937_64& random) {
  const auto below = [&](std::size_t limit) { return 1 + static_cast<std::size_t>(random() % limit); };
  std::vector<Layer> layers;
  const std::size_t depth = below(4);
  std::size_t inputs = 0;
  bool convolve = random() % 2 == 0;
  std::size_t channels = 1;
  std::size_t passed = convolve ? below(3) - 1 : 0;
  inputs = below(60) + passed;
  while (layers.size() < depth) {
    const Activation activation = kActivations[random() % 4];
    const std::size_t length = (inputs - passed) / channels;
    if (convolve) {
      const std::size_t kernel = below(std::min<std::size_t>(length, 9));
      const std::size_t stride = below(4);
      layers.push_back(
          Layer::convolution(channels, length, below(40), kernel, stride, passed, activation));
      channels = layers.back().channels_out;
      convolve = random() % 2 == 0;
    } else {
      layers.push_back(Layer::dense(inputs, below(80), activation));
    }
    inputs = layers.back().outputs();
  }
  return Network(layers);
}

TEST(Inference, AgreesWithDoublePrecisionForRandomNetworksOfAllKinds) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 1500; ++i) {
    Network network = randomNetwork(random);
    randomise(network, random);
    ASSERT_LE(errorOf(network, randomInput(network.inputs(), random)), 1e-6) << i;
  }
}

TEST(Inference, AgreesForEveryNumberOfOutputsAndRemainderOfInputs) {
  std::mt19937_64 random(2);
  for (std::size_t inputs = 1; inputs <= 40; ++inputs) {
    for (std::size_t outputs = 1; outputs <= 40; ++outputs) {
      Network network({Layer::dense(inputs, outputs, Activation::kTanh)});
      randomise(network, random);
      ASSERT_LE(errorOf(network, randomInput(inputs, random)), 1e-6) << inputs << " " << outputs;
    }
  }
}

TEST(Inference, LidarNetworkIsWithinAMillionth) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> range(0.0F, 1.0F);
  for (int i = 0; i < 50; ++i) {
    Network network(
        {Layer::dense(762, 5, Activation::kSigmoid), Layer::dense(5, 31, Activation::kSigmoid)});
    randomise(network, random);
    std::vector<float> input(762);
    for (float& x : input) x = range(random);
    EXPECT_LE(errorOf(network, input), 1e-6);
  }
}

// One input, one output, weight 1: the activation alone.
float activated(Activation activation, float x) {
  Network network({Layer::dense(1, 1, activation)});
  network.parameters() = {1.0, 0.0};
  Inference inference(network);
  float y = 0.0F;
  inference.run(&x, &y);
  return y;
}

TEST(Inference, ActivationsAreWithinTwoMillionthsOfTenOverTheirWholeRange) {
  for (int i = -4000; i <= 4000; ++i) {
    const float x = 0.01F * static_cast<float>(i);
    const auto exact = static_cast<double>(x);
    EXPECT_NEAR(activated(Activation::kTanh, x), std::tanh(exact), 2e-7) << x;
    EXPECT_NEAR(activated(Activation::kSigmoid, x), 1.0 / (1.0 + std::exp(-exact)), 2e-7) << x;
    EXPECT_EQ(activated(Activation::kRelu, x), std::max(x, 0.0F));
    EXPECT_EQ(activated(Activation::kLinear, x), x);
  }
}

TEST(Inference, ActivationsSaturateForHugeSums) {
  for (const float x :
       {100.0F, 1e10F, std::numeric_limits<float>::max(), std::numeric_limits<float>::infinity()}) {
    EXPECT_NEAR(activated(Activation::kTanh, x), 1.0F, 1e-7F);
    EXPECT_NEAR(activated(Activation::kTanh, -x), -1.0F, 1e-7F);
    EXPECT_NEAR(activated(Activation::kSigmoid, x), 1.0F, 1e-7F);
    EXPECT_NEAR(activated(Activation::kSigmoid, -x), 0.0F, 1e-7F);
  }
}

TEST(Inference, ANonFiniteInputShowsInTheOutputs) {
  for (const Activation activation : kActivations) {
    Network network({Layer::dense(40, 3, activation), Layer::dense(3, 2, Activation::kSigmoid)});
    network.randomise(1);
    Inference inference(network);
    std::vector<float> input(40, 0.5F);
    std::vector<float> output(2);
    input[17] = std::numeric_limits<float>::quiet_NaN();
    inference.run(input.data(), output.data());
    EXPECT_TRUE(std::isnan(output[0]) && std::isnan(output[1])) << toString(activation);
  }
}

TEST(Inference, NothingOfOneInputIsLeftForTheNext) {
  std::mt19937_64 random(4);
  Network network = randomNetwork(random);
  randomise(network, random);
  Inference used(network);
  const std::vector<float> input = randomInput(network.inputs(), random);
  std::vector<float> bad(network.inputs(), std::numeric_limits<float>::quiet_NaN());
  std::vector<float> output(network.outputs());
  std::vector<float> expected(network.outputs());
  Inference(network).run(input.data(), expected.data());
  used.run(bad.data(), output.data());
  used.run(input.data(), output.data());
  EXPECT_EQ(output, expected);
}

TEST(Inference, ACopyGivesTheSame) {
  std::mt19937_64 random(5);
  Network network = randomNetwork(random);
  randomise(network, random);
  Inference original(network);
  Inference copy = original;
  const std::vector<float> input = randomInput(network.inputs(), random);
  std::vector<float> a(network.outputs());
  std::vector<float> b(network.outputs());
  original.run(input.data(), a.data());
  copy.run(input.data(), b.data());
  EXPECT_EQ(a, b);
}

std::vector<std::uint32_t> bitsOf(Inference inference, const std::vector<float>& input) {
  std::vector<float> output(inference.outputs());
  inference.run(input.data(), output.data());
  std::vector<std::uint32_t> bits(output.size());
  std::memcpy(bits.data(), output.data(), output.size() * sizeof(float));
  return bits;
}

void expectTheSameOfAllKernels(const Network& network, const std::vector<float>& input) {
  const std::vector<std::uint32_t> bits = bitsOf(InferenceAccess::withKernel(0, network), input);
  for (std::size_t i = 1; i < InferenceAccess::kernels(); ++i) {
    ASSERT_EQ(bitsOf(InferenceAccess::withKernel(i, network), input), bits) << "kernel " << i;
  }
}

TEST(Inference, BitsAreTheSameWithAllInstructionsOfThisMachine) {
  std::mt19937_64 random(7);
  RecordProperty("kernels", static_cast<int>(InferenceAccess::kernels()));
  for (int i = 0; i < 1500 && !HasFatalFailure(); ++i) {
    SCOPED_TRACE(i);
    Network network = randomNetwork(random);
    randomise(network, random);
    expectTheSameOfAllKernels(network, randomInput(network.inputs(), random));
  }
}

TEST(Inference, BitsAreTheSameForEveryNumberOfOutputsAndRemainderOfInputs) {
  std::mt19937_64 random(8);
  for (std::size_t inputs = 1; inputs <= 40; ++inputs) {
    for (std::size_t outputs = 1; outputs <= 40 && !HasFatalFailure(); ++outputs) {
      SCOPED_TRACE(testing::Message() << inputs << " " << outputs);
      Network network({Layer::dense(inputs, outputs, Activation::kSigmoid)});
      randomise(network, random);
      expectTheSameOfAllKernels(network, randomInput(inputs, random));
    }
  }
}

// The sum of the outputs' bits over many networks: the same on every machine, whatever its vectors. The
// figure was made once with SSE2, AVX2 and a build without optimisation.
TEST(Inference, BitsAreTheSameOnEveryMachine) {
  std::mt19937_64 random(6);
  std::uint64_t sum = 0;
  for (int i = 0; i < 200; ++i) {
    Network network({Layer::convolution(1, 40, 5, 7, 3, 1, Activation::kRelu),
                     Layer::dense(61, 9, Activation::kTanh), Layer::dense(9, 31, Activation::kSigmoid)});
    network.randomise(random());
    Inference inference(network);
    std::vector<float> input(network.inputs());
    for (float& x : input) x = static_cast<float>(random() >> 40) * 0x1p-24F;
    std::vector<float> output(network.outputs());
    inference.run(input.data(), output.data());
    for (const float y : output) sum = 31 * sum + static_cast<std::uint64_t>(std::lround(y * 0x1p24F));
  }
  EXPECT_EQ(sum, 10390017095658473405U);
}

}  // namespace
}  // namespace tunnel_pilot::neural
