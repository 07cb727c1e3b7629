#include "tunnel_pilot/drivers/step_driver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace tunnel_pilot::drivers {
namespace {

constexpr double kAmplitude = 0.07;

StepDriver stepDriver() { return StepDriver({kAmplitude, 1.5, 1.5}); }

Proposal proposalOf(double articulation) {
  Proposal proposal;
  proposal.valid = true;
  proposal.articulation_angle = articulation;
  proposal.speed = 3.0;
  proposal.confidence = 0.9;
  return proposal;
}

// What is added in the first 60 s, every 20 ms.
std::vector<double> additions(StepDriver driver, double articulation) {
  std::vector<double> added;
  for (int i = 0; i < 3000; ++i) {
    const Proposal proposal = driver.propose(proposalOf(articulation), fromSeconds(5.0 + 0.02 * i));
    added.push_back(proposal.articulation_angle - articulation);
  }
  return added;
}

TEST(StepDriver, AddsStepsToBothSidesThatCancelOut) {
  const std::vector<double> added = additions(stepDriver(), 0.2);
  double sum = 0.0;
  int steps = 0;
  for (std::size_t i = 1; i < added.size(); ++i) {
    sum += added[i];
    if (std::abs(added[i] - added[i - 1]) > 1e-9) ++steps;
  }
  EXPECT_NEAR(*std::max_element(added.begin(), added.end()), kAmplitude, 1e-9);
  EXPECT_NEAR(*std::min_element(added.begin(), added.end()), -kAmplitude, 1e-9);
  EXPECT_NEAR(sum / static_cast<double>(added.size()), 0.0, 0.1 * kAmplitude);
  EXPECT_NEAR(steps, 40, 3);
}

TEST(StepDriver, AsksForNoMoreSpeedThanItsOwn) {
  StepDriver driver = stepDriver();
  Proposal base = proposalOf(0.0);
  EXPECT_EQ(driver.propose(base, Stamp(0)).speed, 1.5);
  base.speed = 0.5;
  EXPECT_EQ(driver.propose(base, Stamp(0)).speed, 0.5);
}

TEST(StepDriver, WhatTheDriverBeneathDoesNotKnowStaysInvalid) {
  Proposal base = proposalOf(0.0);
  base.valid = false;
  base.stamp = Stamp(77);
  const Proposal proposal = stepDriver().propose(base, Stamp(100));
  EXPECT_FALSE(proposal.valid);
  EXPECT_EQ(proposal.stamp, Stamp(77)) << "its age is checked by the measurement it stems from";
}

TEST(StepDriver, ShippedParametersLoad) {
  const StepDriverParameters p = loadStepDriver(
      config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/step_driver.yaml"));
  EXPECT_EQ(p.speed, 1.5);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
