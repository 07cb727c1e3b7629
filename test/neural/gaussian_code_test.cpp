#include "tunnel_pilot/neural/gaussian_code.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kNodes = 31;
// In degrees, as the paper counts.
const GaussianCode kCode(kNodes, -45.0, 3.0, 5.0);

std::vector<double> encoded(double value, double height = 1.0) {
  std::vector<double> targets(kNodes);
  kCode.encode(value, targets.data());
  for (double& t : targets) t *= height;
  return targets;
}

std::vector<double> sum(std::vector<double> a, const std::vector<double>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
  return a;
}

GaussianCode::Decoded decoded(const std::vector<double>& outputs) {
  return kCode.decode(outputs.data());
}

double argMax(const std::vector<double>& p) {
  return kCode.node(static_cast<std::size_t>(std::max_element(p.begin(), p.end()) - p.begin()));
}

// Centre of gravity of the outputs around the highest, `reach` nodes to either side.
double centroid(const std::vector<double>& p, std::ptrdiff_t reach) {
  const std::ptrdiff_t top = std::max_element(p.begin(), p.end()) - p.begin();
  double weighted = 0.0;
  double total = 0.0;
  for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(p.size()); ++i) {
    if (std::abs(i - top) > reach) continue;
    weighted += p[static_cast<std::size_t>(i)] * kCode.node(static_cast<std::size_t>(i));
    total += p[static_cast<std::size_t>(i)];
  }
  return weighted / total;
}

// RMS error of a way to decode over values within +-40 degrees, with noise on the outputs.
template <typename Decode>
double rmsError(double noise, const Decode& decode) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> draw(0.0, noise);
  double squares = 0.0;
  constexpr int kValues = 4000;
  for (int i = 0; i < kValues; ++i) {
    const double value = -40.0 + 80.0 * i / (kValues - 1);
    std::vector<double> outputs = encoded(value);
    if (noise > 0.0) {
      for (double& p : outputs) p += draw(random);
    }
    const double error = decode(outputs) - value;
    squares += error * error;
  }
  return std::sqrt(squares / kValues);
}

double byFit(const std::vector<double>& outputs) { return decoded(outputs).value; }

TEST(GaussianCode, GivesThePapersPrintedVector) {
  const GaussianCode code(7, 12.0, 1.0, 5.0);
  double targets[7];
  code.encode(14.8, targets);
  const double printed[7] = {0.2085, 0.5231, 0.8799, 0.9920, 0.7498, 0.3798, 0.1290};
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(targets[i], printed[i], 5e-4) << i;
}

TEST(GaussianCode, GridRunsFromFirstInSpacings) {
  EXPECT_DOUBLE_EQ(kCode.node(0), -45.0);
  EXPECT_DOUBLE_EQ(kCode.node(19), 12.0);
  EXPECT_DOUBLE_EQ(kCode.node(30), 45.0);
}

TEST(GaussianCode, DecodesCleanOutputsWithinThreeHundredthsOfADegree) {
  EXPECT_LE(rmsError(0.0, byFit), 0.03);
  // The fitted model is the code's own, so that rounding alone is left.
  EXPECT_LE(rmsError(0.0, byFit), 1e-9);
}

TEST(GaussianCode, DecodesNoisyOutputsBetterThanAnyCentroidAndAFifthOfArgMaxsError) {
  const double fit = rmsError(0.05, byFit);
  EXPECT_NEAR(fit, 0.21, 0.015);
  EXPECT_NEAR(rmsError(0.05, argMax), 1.03, 0.03);
  EXPECT_LE(5.0 * fit, rmsError(0.05, argMax));
  for (std::ptrdiff_t reach = 1; reach <= 30; ++reach) {
    EXPECT_LE(fit, 0.8 * rmsError(0.05, [&](const auto& p) { return centroid(p, reach); })) << reach;
  }
}

TEST(GaussianCode, DecodesUpToTheEndsOfTheGrid) {
  for (const double value : {-45.0, -44.9, -44.0, -42.5, 42.5, 44.0, 44.9, 45.0}) {
    EXPECT_NEAR(decoded(encoded(value)).value, value, 1e-9);
    EXPECT_NEAR(decoded(encoded(value)).confidence, 1.0, 1e-9) << value;
  }
}

TEST(GaussianCode, HoldsValuesBeyondTheGridAtItsEnds) {
  for (const double beyond : {0.5, 2.0, 4.0, 8.0}) {
    EXPECT_NEAR(decoded(encoded(45.0 + beyond)).value, 45.0, 1e-6) << beyond;
    EXPECT_NEAR(decoded(encoded(-45.0 - beyond)).value, -45.0, 1e-6) << beyond;
  }
}

TEST(GaussianCode, NoiseAtTheEndsNeverLeadsOutOfTheGrid) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> noise(0.0, 0.05);
  for (int i = 0; i < 2000; ++i) {
    std::vector<double> outputs = encoded(i % 2 == 0 ? 45.0 : -45.0);
    for (double& p : outputs) p += noise(random);
    const double value = decoded(outputs).value;
    EXPECT_LE(std::abs(value), 45.0);
    EXPECT_GE(std::abs(value), 43.5);
  }
}

TEST(GaussianCode, TellsHeightAndResidualOfTheBell) {
  const GaussianCode::Decoded low = decoded(encoded(7.3, 0.6));
  EXPECT_NEAR(low.height, 0.6, 1e-9);
  EXPECT_NEAR(low.residual, 0.0, 1e-9);
  std::vector<double> outputs = encoded(0.0);
  outputs[0] += 0.31;  // far from the bell
  EXPECT_NEAR(decoded(outputs).residual, 0.31 / std::sqrt(31.0), 1e-6);
}

TEST(GaussianCode, IsSureOfACleanBellAlone) {
  EXPECT_NEAR(decoded(encoded(-17.2)).confidence, 1.0, 1e-9);
  EXPECT_NEAR(decoded(encoded(-17.2, 0.3)).confidence, 0.3, 1e-9);
  EXPECT_LT(decoded(std::vector<double>(kNodes, 0.5)).confidence, 0.05);
  EXPECT_LT(decoded(std::vector<double>(kNodes, 1.0)).confidence, 0.05);
  EXPECT_LT(decoded(sum(encoded(-20.0), encoded(20.0))).confidence, 0.05);
  EXPECT_LT(decoded(sum(encoded(-20.0), encoded(20.0, 0.5))).confidence, 0.7);
}

TEST(GaussianCode, KeepsMostConfidenceUnderNoiseAndLosesItInNoiseAlone) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> small(0.0, 0.05);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  for (int i = 0; i < 500; ++i) {
    std::vector<double> outputs = encoded(-40.0 + 0.16 * i);
    for (double& p : outputs) p += small(random);
    EXPECT_GT(decoded(outputs).confidence, 0.75);
    for (double& p : outputs) p = any(random);
    EXPECT_LT(decoded(outputs).confidence, 0.3);
  }
}

TEST(GaussianCode, CountsSeparateBells) {
  EXPECT_EQ(decoded(encoded(3.1)).peaks, 1);
  EXPECT_EQ(decoded(sum(encoded(-20.0), encoded(20.0))).peaks, 2);
  EXPECT_EQ(decoded(sum(encoded(-8.0), encoded(8.0, 0.6))).peaks, 2);
  EXPECT_EQ(decoded(sum(sum(encoded(-30.0), encoded(0.0)), encoded(30.0))).peaks, 3);
  EXPECT_EQ(decoded(sum(encoded(-20.0), encoded(20.0, 0.2))).peaks, 1);  // too low
  EXPECT_EQ(decoded(sum(encoded(-3.0), encoded(3.0))).peaks, 1);         // run into one
  EXPECT_EQ(decoded(std::vector<double>(kNodes, 0.5)).peaks, 1);         // no valley
  EXPECT_EQ(decoded(encoded(3.1, 0.1)).peaks, 0);
}

TEST(GaussianCode, AWideBellIsOnePeak) {
  const GaussianCode wide(kNodes, -45.0, 3.0, 12.0);
  std::vector<double> outputs(kNodes);
  wide.encode(4.0, outputs.data());
  EXPECT_EQ(decoded(outputs).peaks, 1);
  EXPECT_NEAR(decoded(outputs).value, 4.0, 0.1);
}

TEST(GaussianCode, OneBellUnderNoiseIsOnePeak) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 0.05);
  for (int i = 0; i < 1000; ++i) {
    std::vector<double> outputs = encoded(-40.0 + 0.08 * i);
    for (double& p : outputs) p += noise(random);
    EXPECT_EQ(decoded(outputs).peaks, 1) << i;
  }
}

TEST(GaussianCode, FollowsTheHigherOfTwoBells) {
  EXPECT_NEAR(decoded(sum(encoded(-20.0, 0.7), encoded(20.0))).value, 20.0, 0.01);
  EXPECT_NEAR(decoded(sum(encoded(-20.0), encoded(20.0, 0.7))).value, -20.0, 0.01);
}

TEST(GaussianCode, OutputsWithoutABellGiveNoConfidence) {
  EXPECT_EQ(decoded(std::vector<double>(kNodes, 0.0)).confidence, 0.0);
  EXPECT_EQ(decoded(std::vector<double>(kNodes, -1.0)).confidence, 0.0);
  EXPECT_EQ(decoded(std::vector<double>(kNodes, -1.0)).peaks, 0);
  EXPECT_EQ(decoded(std::vector<double>(kNodes, 1e300)).confidence, 0.0);
}

TEST(GaussianCode, NonFiniteOutputsGiveNoConfidenceAndNoPeak) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
        -std::numeric_limits<float>::infinity()}) {
    for (const std::size_t at : {std::size_t{0}, std::size_t{15}, kNodes - 1}) {
      const std::vector<double> clean = encoded(0.0);
      std::vector<float> outputs(clean.begin(), clean.end());
      outputs[at] = bad;
      const GaussianCode::Decoded result = kCode.decode(outputs.data());
      EXPECT_EQ(result.confidence, 0.0);
      EXPECT_EQ(result.peaks, 0);
      EXPECT_EQ(result.value, 0.0);
    }
  }
}

TEST(GaussianCode, AnyOutputsGiveFiniteResultsWithinTheirRanges) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> power(-40.0, 38.0);
  for (int i = 0; i < 20000; ++i) {
    const GaussianCode code(3 + random() % 60, -45.0, 3.0, 0.5 + static_cast<double>(random() % 30));
    std::vector<float> outputs(code.nodes());
    for (float& p : outputs) {
      p = static_cast<float>(random() % 2 == 0 ? std::pow(10.0, power(random))
                                               : -1.0 + static_cast<double>(random() % 3));
    }
    const GaussianCode::Decoded result = code.decode(outputs.data());
    ASSERT_TRUE(std::isfinite(result.height) && std::isfinite(result.residual));
    ASSERT_TRUE(result.confidence >= 0.0 && result.confidence <= 1.0);
    ASSERT_TRUE(result.peaks >= 0 && result.peaks <= 4);
    ASSERT_TRUE(result.peaks == 0 ||
                (result.value >= -45.0 && result.value <= code.node(code.nodes() - 1)));
  }
}

TEST(GaussianCode, DerivativesAgreeWithFiniteDifferences) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise(0.0, 0.05);
  for (int i = 0; i < 200; ++i) {
    // Within 0.3 spacings of a node, so that no difference is taken across a step of the fit's window.
    const double value = -42.0 + 3.0 * (i % 29) + 0.9 * std::sin(i);
    std::vector<double> outputs = encoded(value, 0.5 + 0.002 * i);
    for (double& p : outputs) p += noise(random);
    std::vector<double> derivatives(kNodes);
    EXPECT_DOUBLE_EQ(kCode.decode(outputs.data(), derivatives.data()), byFit(outputs));
    for (std::size_t j = 0; j < kNodes; ++j) {
      constexpr double kStep = 1e-5;
      std::vector<double> more = outputs;
      std::vector<double> less = outputs;
      more[j] += kStep;
      less[j] -= kStep;
      EXPECT_NEAR(derivatives[j], (byFit(more) - byFit(less)) / (2.0 * kStep), 1e-5) << i << " " << j;
    }
  }
}

TEST(GaussianCode, DerivativesAreZeroWhereTheValueIsHeld) {
  std::vector<double> derivatives(kNodes, 1.0);
  kCode.decode(encoded(49.0).data(), derivatives.data());
  EXPECT_EQ(derivatives, std::vector<double>(kNodes, 0.0));
  const std::vector<double> bad(kNodes, std::nan(""));
  kCode.decode(bad.data(), derivatives.data());
  EXPECT_EQ(derivatives, std::vector<double>(kNodes, 0.0));
}

TEST(GaussianCode, RefusesImpossibleCodes) {
  EXPECT_THROW(GaussianCode(2, 0.0, 1.0, 5.0), std::invalid_argument);
  EXPECT_THROW(GaussianCode(257, 0.0, 1.0, 5.0), std::invalid_argument);
  EXPECT_THROW(GaussianCode(31, std::nan(""), 1.0, 5.0), std::invalid_argument);
  EXPECT_THROW(GaussianCode(31, 0.0, 0.0, 5.0), std::invalid_argument);
  EXPECT_THROW(GaussianCode(31, 0.0, std::nan(""), 5.0), std::invalid_argument);
  EXPECT_THROW(GaussianCode(31, 0.0, 1.0, 0.4), std::invalid_argument);
  EXPECT_THROW(GaussianCode(31, 0.0, 1.0, std::nan("")), std::invalid_argument);
}

}  // namespace
}  // namespace tunnel_pilot::neural
