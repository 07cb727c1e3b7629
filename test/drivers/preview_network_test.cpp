#include "tunnel_pilot/drivers/preview_network.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tunnel_pilot/neural/inference.h"

namespace tunnel_pilot::drivers {
namespace {

using neural::Activation;
using neural::Layer;

constexpr PreviewInputs kSomewhere{0.4, 0.3, -0.2, 0.1};
constexpr AdaptationParameters kLearning{true, 0.05, 0.3, 0.04};

neural::NetworkFile file() {
  neural::NetworkFile file{"preview",
                           neural::Network({Layer::dense(4, 10, Activation::kSigmoid),
                                            Layer::dense(10, 1, Activation::kLinear)}),
                           previewInputGroups({2.5, 2.5, 2.0, 2.0}),
                           {},
                           "",
                           ""};
  file.output.meaning = "articulation_angle";
  file.output.unit = "rad";
  file.output.scale = 0.5;
  file.network.randomise(7);
  return file;
}

TEST(PreviewNetwork, GivesWhatItsFileGives) {
  const neural::NetworkFile of = file();
  PreviewNetwork network(of, kLearning);
  neural::Inference whole(of.network);
  const float inputs[] = {0.4F / 2.5F, 0.3F / 2.5F, -0.2F / 2.0F, 0.1F / 2.0F};
  float output = 0.0F;
  whole.run(inputs, &output);
  EXPECT_NEAR(network.run(kSomewhere), 0.5 * static_cast<double>(output), 1e-6);
}

TEST(PreviewNetwork, HoldsInputsWithinTheirRanges) {
  PreviewNetwork network(file(), kLearning);
  EXPECT_EQ(network.run({100.0, 0.0, 0.0, 0.0}), network.run({2.5, 0.0, 0.0, 0.0}));
  EXPECT_NE(network.run({2.4, 0.0, 0.0, 0.0}), network.run({2.5, 0.0, 0.0, 0.0}));
}

TEST(PreviewNetwork, LearnsToSteerMoreToTheLeftWhereItRanToTheRight) {
  PreviewNetwork network(file(), kLearning);
  const double before = network.run(kSomewhere);
  network.learn(0.2, 1.0);  // the wanted place lies to the left
  const double after = network.run(kSomewhere);
  EXPECT_GT(after, before);
  network.learn(-0.2, 1.0);
  network.learn(-0.2, 1.0);
  EXPECT_LT(network.run(kSomewhere), before);
}

TEST(PreviewNetwork, ItsStepIsRateTimesErrorTimesHiddenOutput) {
  PreviewNetwork network(file(), kLearning);
  const PreviewNetwork::Hidden before = network.weights();
  network.run(kSomewhere);
  network.learn(0.2, 0.5);
  for (std::size_t j = 0; j < before.size(); ++j) {
    EXPECT_NEAR(network.weights()[j] - before[j], 0.05 * 0.5 * 0.2 * network.hidden()[j], 1e-15);
  }
}

TEST(PreviewNetwork, MomentumGoesOnFromTheLastChangeOfTheWeights) {
  // As the paper prints it, alpha would multiply the new step: without an error nothing would move.
  PreviewNetwork network(file(), kLearning);
  const double start = network.weights()[3];
  network.run(kSomewhere);
  network.learn(0.2, 1.0);
  const double first = network.weights()[3] - start;
  network.learn(0.0, 1.0);
  EXPECT_NEAR(network.weights()[3] - start, first + 0.3 * first, 1e-15);
  network.learn(0.0, 1.0);
  EXPECT_NEAR(network.weights()[3] - start, first + 0.3 * first + 0.09 * first, 1e-15);
}

TEST(PreviewNetwork, WeightsStayWithinTheirBound) {
  for (const double bias : {0.3, -0.3}) {  // of the error: weights go to one side
    PreviewNetwork network(file(), kLearning);
    const PreviewNetwork::Hidden trained = network.weights();
    std::mt19937 engine(1);
    std::normal_distribution<double> normal;
    double farthest = 0.0;
    for (int i = 0; i < 20000; ++i) {
      network.run({normal(engine), normal(engine), normal(engine), normal(engine)});
      network.learn(bias + normal(engine), 0.03);
      for (std::size_t j = 0; j < trained.size(); ++j) {
        farthest = std::max(farthest, std::abs(network.weights()[j] - trained[j]));
      }
    }
    EXPECT_NEAR(farthest, kLearning.bound, 1e-12);
  }
}

TEST(PreviewNetwork, AnErrorThatIsNoNumberTeachesNothing) {
  PreviewNetwork network(file(), kLearning);
  const PreviewNetwork::Hidden before = network.weights();
  network.run(kSomewhere);
  network.learn(std::numeric_limits<double>::quiet_NaN(), 1.0);
  EXPECT_EQ(network.weights(), before);
}

TEST(PreviewNetwork, LearnsNothingUnlessToldTo) {
  PreviewNetwork network(file(), {false, 0.05, 0.3, 0.04});
  const PreviewNetwork::Hidden before = network.weights();
  network.run(kSomewhere);
  network.learn(0.2, 1.0);
  EXPECT_EQ(network.weights(), before);
}

TEST(PreviewNetwork, ForgetsWhatItLearnedOnReset) {
  PreviewNetwork network(file(), kLearning);
  const double before = network.run(kSomewhere);
  for (int i = 0; i < 5; ++i) network.learn(0.2, 1.0);
  network.reset();
  EXPECT_EQ(network.run(kSomewhere), before);
  network.learn(0.0, 1.0);  // nor does a momentum go on
  EXPECT_EQ(network.run(kSomewhere), before);
}

TEST(PreviewNetwork, RefusesOtherNetworks) {
  const auto refused = [](const neural::NetworkFile& other) {
    EXPECT_THROW(PreviewNetwork(other, kLearning), config::ConfigError);
  };
  neural::NetworkFile other = file();
  other.network = neural::Network(
      {Layer::dense(4, 9, Activation::kSigmoid), Layer::dense(9, 1, Activation::kLinear)});
  refused(other);
  other.network = neural::Network(
      {Layer::dense(4, 10, Activation::kTanh), Layer::dense(10, 1, Activation::kLinear)});
  refused(other);
  other = file();
  std::swap(other.inputs[1], other.inputs[2]);
  refused(other);
  other = file();
  other.inputs[3].unit = "mm";
  refused(other);
  other = file();
  other.output.code = neural::OutputGroup::Code::kGaussian;
  refused(other);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
