#include "tunnel_pilot/simulation/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

// 40 m straight, 12 m radius bend of 12 m, 40 m straight.
geometry::Path straightBendStraight() {
  return geometry::buildPath({{40.0, 0.0, 0.0}, {12.0, 1.0 / 12, 1.0 / 12}, {40.0, 0.0, 0.0}}, {}, 0.1);
}

std::vector<TrackSample> driveAlong(double from, double to, double step) {
  std::vector<TrackSample> track;
  for (double s = from; s <= to; s += step) {
    TrackSample sample;
    sample.time = s / 3.0;
    sample.station = s;
    sample.speed = 3.0;
    sample.clearance = 1.0;
    track.push_back(sample);
  }
  return track;
}

TEST(DriveMetrics, OffsetsMeanRmsAndLargestAreThoseOfTheTrack) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (std::size_t i = 0; i < track.size(); ++i) track[i].lateral_offset = i % 2 == 0 ? -0.3 : 0.1;
  const Metrics metrics = driveMetrics(track, straightBendStraight());
  EXPECT_NEAR(metrics.at("lateral_mean"), -0.1, 1e-3);
  EXPECT_NEAR(metrics.at("lateral_rms"), std::sqrt(0.05), 1e-3);
  EXPECT_DOUBLE_EQ(metrics.at("lateral_max"), 0.3);
  EXPECT_NEAR(metrics.at("distance"), 90.0, 0.2);
}

TEST(DriveMetrics, HeadingOnStraightsLeavesTheBendOut) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (TrackSample& s : track) s.heading_error = s.station > 40.0 && s.station < 52.0 ? 0.2 : 0.01;
  const Metrics metrics = driveMetrics(track, straightBendStraight());
  EXPECT_NEAR(metrics.at("heading_rms_straights"), 0.01, 1e-3);
  EXPECT_GT(metrics.at("heading_rms"), 0.05);
}

TEST(DriveMetrics, ArticulationUnwindingAfterABendIsNoSnaking) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (TrackSample& s : track) {
    if (s.station > 38.0 && s.station < 52.0) s.articulation = 0.4;
    if (s.station >= 52.0) s.articulation = 0.4 * std::exp(-(s.station - 52.0) / 3.17);
  }
  EXPECT_LT(driveMetrics(track, straightBendStraight()).at("articulation_std_straights"), 0.005);
}

TEST(DriveMetrics, ASwayingHingeOnTheStraightIsSnaking) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (TrackSample& s : track) s.articulation = 0.05 + 0.02 * std::sin(s.station * 2.0);
  EXPECT_NEAR(driveMetrics(track, straightBendStraight()).at("articulation_std_straights"),
              0.02 / std::sqrt(2.0), 5e-4);
}

TEST(DriveMetrics, StandstillDoesNotDiluteTheFiguresButItsClearanceCounts) {
  auto track = driveAlong(0.0, 30.0, 0.1);
  for (TrackSample& s : track) s.lateral_offset = 0.2;
  for (int i = 0; i < 10'000; ++i) {
    TrackSample standing;
    standing.clearance = 0.4;
    track.push_back(standing);
  }
  const Metrics metrics = driveMetrics(track, straightBendStraight());
  EXPECT_NEAR(metrics.at("lateral_rms"), 0.2, 1e-9);
  EXPECT_DOUBLE_EQ(metrics.at("clearance_min"), 0.4);
}

TEST(DriveMetrics, OffsetsInBendsAreToldBySideAndAsCutting) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (TrackSample& s : track) {
    s.curvature = s.station < 30.0 ? 0.0 : s.station < 60.0 ? 0.05 : -0.05;
    s.lateral_offset = s.curvature == 0.0 ? 0.5 : s.curvature > 0.0 ? 0.2 : 0.1;
  }
  const Metrics metrics = driveMetrics(track, straightBendStraight());
  EXPECT_NEAR(metrics.at("lateral_mean_left_bends"), 0.2, 1e-9);
  EXPECT_NEAR(metrics.at("lateral_rms_left_bends"), 0.2, 1e-9);
  EXPECT_NEAR(metrics.at("lateral_mean_right_bends"), 0.1, 1e-9);
  EXPECT_NEAR(metrics.at("lateral_rms_right_bends"), 0.1, 1e-9);
  EXPECT_NEAR(metrics.at("inside_mean"), (0.2 - 0.1) / 2.0, 1e-3);
}

TEST(DriveMetrics, WithoutABendToOneSideItsOffsetIsNotTold) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (TrackSample& s : track) s.curvature = s.station < 30.0 ? 0.0 : 0.05;
  const Metrics metrics = driveMetrics(track, straightBendStraight());
  EXPECT_EQ(metrics.count("lateral_mean_left_bends"), 1u);
  EXPECT_EQ(metrics.count("lateral_mean_right_bends"), 0u);
}

TEST(DriveMetrics, LargestSpeedOnStraightsLeavesTheBendOut) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (TrackSample& s : track) s.speed = s.station > 40.0 && s.station < 52.0 ? 6.0 : s.station / 20.0;
  EXPECT_NEAR(driveMetrics(track, straightBendStraight()).at("speed_max_straights"), 4.5, 0.01);
}

TEST(DriveMetrics, AStopIsAStandstillAfterDrivingNotTheOneItStartsFrom) {
  auto track = driveAlong(0.0, 90.0, 0.1);
  for (std::size_t i = 0; i < track.size(); ++i) track[i].speed = i < 50 ? 0.0 : 3.0;
  EXPECT_EQ(driveMetrics(track, straightBendStraight()).at("stops"), 0.0);
  for (std::size_t i = 300; i < 330; ++i) track[i].speed = i % 2 == 0 ? 0.0 : 0.06;  // stands, shaking
  for (std::size_t i = 600; i < 640; ++i) track[i].speed = 0.0;
  EXPECT_EQ(driveMetrics(track, straightBendStraight()).at("stops"), 2.0);
}

TEST(ReturnMetrics, FindTheCrossingsTheSettlingAndTheOvershoot) {
  std::vector<TrackSample> track;
  for (int i = 0; i <= 1000; ++i) {
    TrackSample s;
    s.time = 5.0 + 0.01 * i;
    const double t = 0.01 * i;
    s.lateral_offset = -0.7 * std::cos(t) * std::exp(-t);
    s.heading_error = t < 2.0 ? -0.3 : 0.1;
    track.push_back(s);
  }
  const Metrics metrics = returnMetrics(track);
  EXPECT_NEAR(metrics.at("heading_zero_time"), 2.0, 0.011);
  // 0.7 cos(t) exp(-t) = 0.1 at t = 1.118; its overshoot stays below 0.1.
  EXPECT_NEAR(metrics.at("settle_time"), 1.118, 0.011);
  EXPECT_NEAR(metrics.at("overshoot"), 0.7 * std::exp(-2.3562) * 0.70711, 1e-3);
}

TEST(ReturnMetrics, WhatNeverHappensTakesForEver) {
  std::vector<TrackSample> track(10);
  for (TrackSample& s : track) {
    s.lateral_offset = 0.5;
    s.heading_error = 0.1;
  }
  const Metrics metrics = returnMetrics(track);
  EXPECT_TRUE(std::isinf(metrics.at("heading_zero_time")));
  EXPECT_TRUE(std::isinf(metrics.at("settle_time")));
}

TEST(SteadyTurnMetrics, TimeRadiusAndAccelerationOfACircle) {
  std::vector<TrackSample> track;
  const double radius = 24.4, speed = 3.0;
  for (int i = 0; i <= 4000; ++i) {
    TrackSample s;
    s.time = 0.02 * i;
    const double angle = speed / radius * s.time;
    s.front = {radius * std::sin(angle), radius * (1 - std::cos(angle)), geometry::wrapAngle(angle)};
    s.lateral_acceleration = speed * speed / radius;
    track.push_back(s);
  }
  const Metrics metrics = steadyTurnMetrics(track, 5.0, 500.0 / 57.29577951308232);
  EXPECT_NEAR(metrics.at("turn_time"), 8.7266463 * radius / speed, 1e-6);
  EXPECT_NEAR(metrics.at("turn_radius"), radius, 1e-3);
  EXPECT_NEAR(metrics.at("lateral_acceleration"), 0.3689, 1e-3);
}

TEST(SteadyTurnMetrics, ATurnTooShortIsNeverDone) {
  std::vector<TrackSample> track(100);
  for (std::size_t i = 0; i < track.size(); ++i) {
    track[i].time = 0.1 * static_cast<double>(i);
    track[i].front.heading = 0.01 * static_cast<double>(i);
  }
  EXPECT_TRUE(std::isinf(steadyTurnMetrics(track, 1.0, 8.7).at("turn_time")));
  EXPECT_THROW(steadyTurnMetrics(track, 20.0, 8.7), std::invalid_argument);
}

TEST(PerceptionMetrics, ErrorsAreSortedByTheBendsRadius) {
  std::vector<PerceptionSample> samples;
  const auto add = [&](double radius, double error) {
    PerceptionSample s;
    s.curvature = radius == 0.0 ? 0.0 : 1.0 / radius;
    s.valid = true;
    s.heading_error = error;
    s.offset_error = -0.03;
    s.width_error = 0.06;
    samples.push_back(s);
  };
  for (const double error : {0.01, -0.02, 0.03}) add(-12.0, error);
  add(16.0, 0.02);
  add(8.0, 0.02);
  add(30.0, 0.5);
  add(0.0, -0.001);
  samples.emplace_back();  // not valid: counts as unanswered only
  const Metrics metrics = perceptionMetrics(samples);
  EXPECT_DOUBLE_EQ(metrics.at("tight_heading_median"), 0.02);
  EXPECT_NEAR(metrics.at("tight_heading_p95"), 0.028, 1e-12);
  EXPECT_DOUBLE_EQ(metrics.at("gentle_heading_median"), 0.5);
  EXPECT_DOUBLE_EQ(metrics.at("straight_heading_median"), 0.001);
  EXPECT_DOUBLE_EQ(metrics.at("offset_error_median"), 0.03);
  EXPECT_DOUBLE_EQ(metrics.at("width_error_p95"), 0.06);
  EXPECT_DOUBLE_EQ(metrics.at("valid_share"), 7.0 / 8.0);
}

TEST(Quantile, InterpolatesBetweenOrderStatistics) {
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_DOUBLE_EQ(quantile({1.0, 2.0}, 0.25), 1.25);
  EXPECT_TRUE(std::isinf(quantile({1.0, INFINITY, INFINITY}, 1.0)));
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

}  // namespace
}  // namespace tunnel_pilot::simulation
