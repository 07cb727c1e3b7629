#include "tunnel_pilot/drivers/scan_domain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "random_network.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/inverse_ranges.h"

namespace tunnel_pilot::drivers {
namespace {

using Features = ScanDomain::Features;

std::vector<Features> gaussianExamples(std::size_t count) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<Features> examples(count);
  for (Features& example : examples) {
    const double common = 0.5 * normal(random);
    for (double& feature : example) feature = -1.0 + common + 0.2 * normal(random);
  }
  return examples;
}

TEST(InverseRanges, AreStraightAcrossAGapAndStayAtTheEnds) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> inverse;
  ASSERT_TRUE(
      invertRanges({nan, 2.0F, nan, std::numeric_limits<float>::infinity(), 5.0F, 0.0F}, inverse));
  const std::vector<float> expected = {0.5F, 0.5F, 0.4F, 0.3F, 0.2F, 0.2F};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(inverse[i], expected[i], 1e-6F) << i;
  EXPECT_FALSE(invertRanges({nan, nan}, inverse));
}

TEST(ScanDomain, FeaturesAreTheLogarithmOfEachSectorsMean) {
  std::vector<float> inverse(761, 0.5F);
  std::fill(inverse.begin(), inverse.begin() + 40, 2.0F);  // the first of 19 sectors
  const Features features = ScanDomain::features(inverse);
  EXPECT_NEAR(features[0], std::log(2.0), 1e-9);
  for (std::size_t k = 1; k < features.size(); ++k) EXPECT_NEAR(features[k], std::log(0.5), 1e-9);
}

TEST(ScanDomain, TheDistanceOfGaussianExamplesIsTheirDimensionInTheMean) {
  const auto examples = gaussianExamples(20000);
  const ScanDomain domain(ScanDomain::fit(examples), "test");
  double mean = 0.0;
  for (const Features& example : examples) mean += domain.distance(example) / 20000.0;
  EXPECT_NEAR(mean, 19.0, 0.5);
}

TEST(ScanDomain, OneInAThousandOfTheExamplesLiesBeyondTheLimitOverItsShare) {
  const auto examples = gaussianExamples(20000);
  const neural::InputDomain fitted = ScanDomain::fit(examples);
  const ScanDomain domain(fitted, "test");
  const auto beyond = std::count_if(examples.begin(), examples.end(), [&](const Features& example) {
    return domain.distance(example) > fitted.limit / 0.6;
  });
  EXPECT_NEAR(static_cast<double>(beyond), 20.0, 2.0);
}

// What never varied together in training is foreign even where each feature alone is not.
TEST(ScanDomain, AForeignCombinationOfUsualFeaturesIsFar) {
  const neural::InputDomain fitted = ScanDomain::fit(gaussianExamples(20000));
  const ScanDomain domain(fitted, "test");
  Features together{};
  together.fill(-0.5);
  Features apart{};
  for (std::size_t k = 0; k < apart.size(); ++k) apart[k] = k % 2 == 0 ? -0.5 : -1.5;
  EXPECT_LT(domain.distance(together), fitted.limit);
  EXPECT_GT(domain.distance(apart), fitted.limit);
}

TEST(ScanDomain, FamiliarityIsOneWithinTheLimitAndFallsBeyond) {
  const ScanDomain domain(ScanDomain::fit(gaussianExamples(2000)), "test");
  const std::vector<float> usual(761, static_cast<float>(std::exp(-1.0)));
  EXPECT_EQ(domain.familiarity(usual), 1.0);
  double last = 1.0;
  for (const float factor : {100.0F, 1e3F, 1e4F}) {
    std::vector<float> scaled = usual;
    for (float& value : scaled) value *= factor;
    EXPECT_LT(domain.familiarity(scaled), last);
    last = domain.familiarity(scaled);
  }
}

TEST(ScanDomain, FeaturesThatNeverVariedCanBeFitted) {
  std::vector<Features> same(1000);
  for (Features& example : same) example.fill(-1.0);
  const ScanDomain domain(ScanDomain::fit(same), "test");
  EXPECT_TRUE(std::isfinite(domain.distance(Features{})));
  EXPECT_GT(domain.distance(Features{}), 100.0);
}

TEST(ScanDomain, TooFewExamplesOrSuchThatAreNoNumbersAreRefused) {
  EXPECT_THROW(ScanDomain::fit(gaussianExamples(189)), std::invalid_argument);
  auto examples = gaussianExamples(1000);
  examples[7][3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ScanDomain::fit(examples), std::invalid_argument);
}

TEST(ScanDomain, ADomainOfOtherFeaturesIsRefused) {
  neural::InputDomain domain = ScanDomain::fit(gaussianExamples(1000));
  domain.meaning = "other";
  EXPECT_THROW(ScanDomain(domain, "test"), config::ConfigError);
  domain.meaning = ScanDomain::kMeaning;
  domain.mean.pop_back();
  EXPECT_THROW(ScanDomain(domain, "test"), config::ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
