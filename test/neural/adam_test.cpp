#include "tunnel_pilot/neural/adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/diverged.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/loss.h"

namespace tunnel_pilot::neural {
namespace {

TEST(Adam, FirstStepsFollowTheFormula) {
  Adam adam(2, {0.1, 0.9, 0.99, 1e-8, 0.0});
  std::vector<double> p = {1.0, -1.0};
  adam.step(p, {4.0, -0.5});
  // With the bias corrections the first step is the rate itself, against the sign.
  EXPECT_NEAR(p[0], 0.9, 1e-8);
  EXPECT_NEAR(p[1], -0.9, 1e-8);
  adam.step(p, {2.0, -0.5});
  const double m = (0.9 * 0.1 * 4.0 + 0.1 * 2.0) / (1.0 - 0.81);
  const double v = (0.99 * 0.01 * 16.0 + 0.01 * 4.0) / (1.0 - 0.9801);
  EXPECT_NEAR(p[0], 0.9 - 0.1 * m / std::sqrt(v), 1e-8);
}

TEST(Adam, RateFactorScalesTheStep) {
  Adam adam(1, {0.1, 0.9, 0.99, 1e-8, 0.0});
  std::vector<double> p = {1.0};
  adam.step(p, {3.0}, 0.25);
  EXPECT_NEAR(p[0], 0.975, 1e-8);
}

TEST(Adam, WeightDecayPullsTowardsZeroWithoutAGradient) {
  Adam adam(1, {0.1, 0.9, 0.99, 1e-8, 0.5});
  std::vector<double> p = {2.0};
  adam.step(p, {0.0});
  EXPECT_NEAR(p[0], 2.0 - 0.1 * 0.5 * 2.0, 1e-12);
}

TEST(Adam, DivergenceIsSaidAndLeavesTheParameters) {
  Adam adam(2, {});
  std::vector<double> p = {1.0, 2.0};
  EXPECT_THROW(adam.step(p, {0.1, std::nan("")}), Diverged);
  EXPECT_THROW(adam.step(p, {std::numeric_limits<double>::infinity(), 0.0}), Diverged);
  EXPECT_THROW(adam.step(p, {1e200, 0.0}), Diverged);  // its square is infinite
  EXPECT_EQ(p, (std::vector<double>{1.0, 2.0}));
  adam.step(p, {0.0, 0.0});  // nor did its memory take it in
  EXPECT_EQ(p, (std::vector<double>{1.0, 2.0}));
  std::vector<double> lost = {std::nan(""), 0.0};
  EXPECT_THROW(adam.step(lost, {0.0, 0.0}), Diverged);
}

TEST(Adam, RefusesWrongSizesAndSettings) {
  Adam adam(2, {});
  std::vector<double> p = {1.0};
  EXPECT_THROW(adam.step(p, {0.1, 0.1}), std::invalid_argument);
  EXPECT_THROW(Adam(1, {-1.0, 0.9, 0.99, 1e-8, 0.0}), std::invalid_argument);
  EXPECT_THROW(Adam(1, {0.1, 1.0, 0.99, 1e-8, 0.0}), std::invalid_argument);
  EXPECT_THROW(Adam(1, {0.1, 0.9, -0.1, 1e-8, 0.0}), std::invalid_argument);
  EXPECT_THROW(Adam(1, {0.1, 0.9, 0.99, 0.0, 0.0}), std::invalid_argument);
  EXPECT_THROW(Adam(1, {0.1, 0.9, 0.99, 1e-8, -1.0}), std::invalid_argument);
}

// A bell-coded angle from two features: soft targets, cross-entropy, mini-batches of one BatchPass.
class SoftTargets : public testing::Test {
 protected:
  static constexpr std::size_t kNodes = 11;
  static constexpr std::size_t kLanes = BatchPass::kLanes;

  // Fills the lanes with samples and returns their values.
  void draw(BatchPass& pass, double* values) {
    std::uniform_real_distribution<double> draw(-1.0, 1.0);
    for (std::size_t l = 0; l < kLanes; ++l) {
      const double a = draw(random_);
      const double b = draw(random_);
      pass.input(0)[l] = a;
      pass.input(1)[l] = b;
      values[l] = 2.0 * (a + a * b);  // within +-4
    }
  }
  double lossOf(BatchPass& pass, const double* values) {
    double loss = 0.0;
    for (std::size_t i = 0; i < kNodes; ++i) {
      double targets[kLanes];
      for (std::size_t l = 0; l < kLanes; ++l) {
        double all[kNodes];
        code_.encode(values[l], all);
        targets[l] = all[i];
      }
      loss += crossEntropy(pass.output(i), targets, kLanes, pass.outputGradient(i));
    }
    return loss / kLanes;
  }
  double decodeError(const BatchPass& pass, const double* values) {
    double squares = 0.0;
    for (std::size_t l = 0; l < kLanes; ++l) {
      double outputs[kNodes];
      for (std::size_t i = 0; i < kNodes; ++i) outputs[i] = pass.output(i)[l];
      squares += std::pow(code_.decode(outputs).value - values[l], 2);
    }
    return std::sqrt(squares / kLanes);
  }

  GaussianCode code_{kNodes, -5.0, 1.0, 5.0};
  std::mt19937_64 random_{1};
};

TEST_F(SoftTargets, LearnsABellCodedValueWithinTwoThousandBatches) {
  Network network(
      {Layer::dense(2, 12, Activation::kTanh), Layer::dense(12, kNodes, Activation::kSigmoid)});
  network.randomise(1);
  BatchPass pass(network);
  Adam adam(network.parameters().size(), {1e-2, 0.9, 0.999, 1e-8, 0.0});
  std::vector<double> curve;
  std::vector<double> gradient(network.parameters().size());
  double values[kLanes];
  for (int batch = 0; batch < 2000; ++batch) {
    draw(pass, values);
    pass.forward();
    const double loss = lossOf(pass, values);
    if (batch == 0 || batch == 100 || batch == 500) curve.push_back(loss);
    std::fill(gradient.begin(), gradient.end(), 0.0);
    pass.backward(gradient);
    for (double& g : gradient) g /= kLanes;
    adam.step(network.parameters(), gradient);
  }
  draw(pass, values);
  pass.forward();
  curve.push_back(lossOf(pass, values));
  for (std::size_t i = 1; i < curve.size(); ++i) EXPECT_LT(curve[i], curve[i - 1]) << i;
  EXPECT_LT(curve.back(), 0.03 * curve.front());
  EXPECT_LT(decodeError(pass, values), 0.15);
}

}  // namespace
}  // namespace tunnel_pilot::neural
