#include "tunnel_pilot/supervision/speed_governor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::supervision {
namespace {

SpeedGovernorParameters parameters() {
  SpeedGovernorParameters p{};
  p.max_speed = 9.0;
  p.max_lateral_acceleration = 1.8;
  p.max_articulation_rate = 0.21;
  p.rate_window = 2.0;
  p.bend_deceleration = 0.7;
  p.sight_deceleration = 1.0;
  p.reaction_time = 0.55;
  p.sight_reserve = 2.0;
  return p;
}

SpeedGovernor::Limit limitOn(const std::vector<geometry::PathPiece>& pieces, double s) {
  drivers::ArticulationProfile profile;
  const vehicle::TruckGeometry truck =
      vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml").geometry;
  profile.build(geometry::buildPath(pieces, {}, 0.25), truck, 0.5);
  return SpeedGovernor(parameters()).alongPath(profile, s);
}

TEST(SpeedGovernor, AStraightIsLimitedByTheHighestSpeedOnly) {
  const SpeedGovernor::Limit limit = limitOn({{40.0, 0.0, 0.0}}, 2.0);
  EXPECT_EQ(limit.speed, 9.0);
  EXPECT_EQ(limit.by, SpeedLimit::kNone);
}

TEST(SpeedGovernor, WithoutAProfileTheHighestSpeedLimits) {
  const SpeedGovernor::Limit limit = SpeedGovernor(parameters()).alongPath({}, 0.0);
  EXPECT_EQ(limit.speed, 9.0);
  EXPECT_EQ(limit.by, SpeedLimit::kNone);
}

TEST(SpeedGovernor, EveryLimitHasItsOwnName) {
  std::set<std::string> names;
  for (int code = 0; code <= static_cast<int>(SpeedLimit::kLimiter); ++code) {
    EXPECT_TRUE(names.insert(toString(static_cast<SpeedLimit>(code))).second) << code;
  }
  EXPECT_EQ(names.count("unknown"), 0u);
  EXPECT_EQ(toString(static_cast<SpeedLimit>(255)), "unknown");
}

TEST(SpeedGovernor, AnArcIsLimitedByLateralAcceleration) {
  const SpeedGovernor::Limit limit = limitOn({{40.0, 1.0 / 12.0, 1.0 / 12.0}}, 2.0);
  EXPECT_NEAR(limit.speed, std::sqrt(1.8 * 12.0), 0.01);
  EXPECT_EQ(limit.by, SpeedLimit::kLateralAcceleration);
}

TEST(SpeedGovernor, AReversalOfTightBendsIsLimitedByTheSteeringsRate) {
  // From +1/12 to -1/12 within 8 m the articulation turns by 0.87 rad: 0.21 rad/s allow 2.3 m/s.
  const double k = 1.0 / 12.0;
  const SpeedGovernor::Limit limit = limitOn({{20.0, k, k}, {8.0, k, -k}, {20.0, -k, -k}}, 24.0);
  EXPECT_EQ(limit.by, SpeedLimit::kArticulationRate);
  EXPECT_NEAR(limit.speed, 2.3, 0.2);
}

TEST(SpeedGovernor, SlowsDownForABendBeforeItIsReached) {
  const double k = 1.0 / 12.0;
  const std::vector<geometry::PathPiece> pieces = {{60.0, 0.0, 0.0}, {8.0, 0.0, k}, {20.0, k, k}};
  const double far = limitOn(pieces, 5.0).speed;
  const double near = limitOn(pieces, 55.0).speed;
  const double inside = limitOn(pieces, 70.0).speed;
  EXPECT_GT(far, near);
  EXPECT_GT(near, inside);
  // From 10 m before a limit v_1, braking after the reaction: v t + (v^2 - v_1^2) / 2b <= 10 m.
  EXPECT_LE(near * 0.55 + (near * near - inside * inside) / (2.0 * 0.7), 13.0 + 1e-6);
}

TEST(SpeedGovernor, SightAllowsTheSpeedOfTheSpecification) {
  // 35 m of sight, 0.55 s, on 15 % descent (2.5 m/s^2 less gravity): 28.6 km/h.
  SpeedGovernorParameters p = parameters();
  p.sight_deceleration = 2.5 - 9.81 * std::sin(std::atan(0.15));
  p.sight_reserve = 0.0;
  EXPECT_NEAR(SpeedGovernor(p).stoppingWithin(35.0) * 3.6, 28.6, 0.4);
}

TEST(SpeedGovernor, StopsWithinItsSightFromTheSpeedItAllows) {
  const SpeedGovernor governor(parameters());
  for (const double sight : {3.0, 5.0, 10.0, 20.0}) {
    const double v = governor.stoppingWithin(sight);
    EXPECT_NEAR(v * 0.55 + v * v / 2.0, sight - 2.0, 1e-9);
  }
}

TEST(SpeedGovernor, WithoutSightThereIsNoSpeed) {
  const SpeedGovernor governor(parameters());
  EXPECT_EQ(governor.stoppingWithin(2.0), 0.0);
  EXPECT_EQ(governor.stoppingWithin(-1.0), 0.0);
  EXPECT_EQ(governor.stoppingWithin(std::numeric_limits<double>::quiet_NaN()), 0.0);
}

}  // namespace
}  // namespace tunnel_pilot::supervision
