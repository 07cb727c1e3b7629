#include "tunnel_pilot/simulation/ideal_drive.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

supervision::SpeedGovernorParameters limits() {
  supervision::SpeedGovernorParameters p{};
  p.max_speed = 7.0;
  p.max_lateral_acceleration = 1.8;
  p.max_articulation_rate = 0.21;
  p.rate_window = 2.0;
  p.bend_deceleration = 0.7;
  p.sight_deceleration = 1.0;
  p.reaction_time = 0.55;
  p.sight_reserve = 2.0;
  return p;
}

vehicle::TruckGeometry truck() {
  return vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml").geometry;
}

double idealTime(const geometry::Path& line, const IdealDrive& drive) {
  return idealDriveTime(line, drive, supervision::SpeedGovernor(limits()), truck());
}

const geometry::Path kStraight = geometry::buildPath({{400.0, 0.0, 0.0}}, {}, 0.5);

TEST(IdealDrive, OnAStraightIsARampAndThenTheTopSpeed) {
  // 0.8 m/s^2 from standstill to 6 m/s: 7.5 s, 22.5 m.
  EXPECT_NEAR(idealTime(kStraight, {20.0, 200.0, 0.0, 6.0, 0.8, 100.0}), 7.5 + 177.5 / 6.0, 0.05);
  EXPECT_NEAR(idealTime(kStraight, {20.0, 200.0, 6.0, 6.0, 0.8, 100.0}), 200.0 / 6.0, 1e-9);
}

TEST(IdealDrive, IsNoFasterThanTheGovernorsHighestSpeed) {
  EXPECT_NEAR(idealTime(kStraight, {20.0, 200.0, 7.0, 9.0, 0.8, 100.0}), 200.0 / 7.0, 1e-9);
}

TEST(IdealDrive, StopsWithinWhatItSees) {
  const double room = 20.0 - truck().front_overhang - 2.0;
  const double speed = -0.55 + std::sqrt(0.55 * 0.55 + 2.0 * room);
  EXPECT_NEAR(idealTime(kStraight, {20.0, 200.0, speed, 7.0, 0.8, 20.0}), 200.0 / speed, 1e-9);
}

TEST(IdealDrive, RoundACircleIsLimitedByLateralAccelerationAndMayPassItsStart) {
  const double k = 1.0 / 20.0;
  const double round = 2.0 * 3.141592653589793 / k;
  const geometry::Path circle = geometry::buildPath({{round, k, k}}, {}, 0.25, true);
  const double speed = std::sqrt(1.8 / k);
  EXPECT_NEAR(idealTime(circle, {100.0, round, speed, 7.0, 0.8, 100.0}), round / speed, 0.01);
}

// The way of the braking is the governor's: from 7 m/s at 0.7 m/s^2 to the arc's speed.
TEST(IdealDrive, SlowsDownBeforeABendAndSpeedsUpBehindIt) {
  const double k = 1.0 / 12.0;
  const geometry::Path line = geometry::buildPath(
      {{100.0, 0.0, 0.0}, {10.0, 0.0, k}, {20.0, k, k}, {10.0, k, 0.0}, {100.0, 0.0, 0.0}}, {}, 0.25);
  const double bend = std::sqrt(1.8 / k);  // 4.65 m/s
  const double slowest = 240.0 / bend;
  const double fastest = 40.0 / bend + 200.0 / 7.0;  // as if speeds could step
  const double time = idealTime(line, {0.0, 240.0, 7.0, 7.0, 0.8, 100.0});
  EXPECT_LT(time, slowest);
  EXPECT_GT(time, fastest);
  const double slow_to_brake = (7.0 - bend) / 0.7 * (1.0 - 0.5 * (7.0 + bend) / 7.0);
  const double slow_to_gain = (7.0 - bend) / 0.8 * (1.0 - 0.5 * (7.0 + bend) / 7.0);
  EXPECT_NEAR(time, fastest + slow_to_brake + slow_to_gain, 1.6) << "clothoids and reaction time apart";
}

}  // namespace
}  // namespace tunnel_pilot::simulation
