#include "tunnel_pilot/neural/loss.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tunnel_pilot::neural {
namespace {

void expectGradient(Loss loss, const double* outputs, const double* targets) {
  double gradient[3];
  loss(outputs, targets, 3, gradient);
  for (std::size_t i = 0; i < 3; ++i) {
    constexpr double kStep = 1e-6;
    double unused[3];
    double more[3] = {outputs[0], outputs[1], outputs[2]};
    double less[3] = {outputs[0], outputs[1], outputs[2]};
    more[i] += kStep;
    less[i] -= kStep;
    const double slope =
        (loss(more, targets, 3, unused) - loss(less, targets, 3, unused)) / (2.0 * kStep);
    EXPECT_NEAR(gradient[i], slope, 1e-7 * (1.0 + std::abs(slope)));
  }
}

TEST(Loss, HalfSquaredErrorAndItsGradient) {
  const double outputs[3] = {0.5, -2.0, 3.0};
  const double targets[3] = {1.5, -2.0, 1.0};
  double gradient[3];
  EXPECT_DOUBLE_EQ(halfSquaredError(outputs, targets, 3, gradient), 2.5);
  expectGradient(halfSquaredError, outputs, targets);
}

TEST(Loss, CrossEntropyAndItsGradient) {
  const double outputs[3] = {0.5, 0.2, 0.9};
  const double targets[3] = {1.0, 0.2, 0.0};
  double gradient[3];
  EXPECT_NEAR(crossEntropy(outputs, targets, 3, gradient), std::log(2.0) + std::log(10.0), 1e-12);
  expectGradient(crossEntropy, outputs, targets);
}

TEST(Loss, CrossEntropyIsZeroForPerfectSoftOutputs) {
  const double targets[3] = {0.3, 0.999, 1e-9};
  double gradient[3];
  EXPECT_NEAR(crossEntropy(targets, targets, 3, gradient), 0.0, 1e-12);
  for (const double g : gradient) EXPECT_NEAR(g, 0.0, 1e-12);
}

TEST(Loss, CrossEntropyStaysFiniteForSaturatedOutputs) {
  const double outputs[3] = {0.0, 1.0, 1.0};
  const double targets[3] = {1.0, 0.0, 0.5};
  double gradient[3];
  EXPECT_TRUE(std::isfinite(crossEntropy(outputs, targets, 3, gradient)));
  for (const double g : gradient) EXPECT_TRUE(std::isfinite(g));
}

TEST(Loss, CrossEntropyOfWhatIsNoProbabilityIsNotANumber) {
  const double outputs[3] = {0.5, 1.5, 0.5};
  const double targets[3] = {0.5, 0.5, 0.5};
  double gradient[3];
  EXPECT_TRUE(std::isnan(crossEntropy(outputs, targets, 3, gradient)));
}

}  // namespace
}  // namespace tunnel_pilot::neural
