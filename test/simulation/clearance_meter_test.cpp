#include "tunnel_pilot/simulation/clearance_meter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot::simulation {
namespace {

std::vector<geometry::Point> box(const geometry::Pose& pose, double length, double width) {
  return {pose.transform({0.5 * length, -0.5 * width}), pose.transform({0.5 * length, 0.5 * width}),
          pose.transform({-0.5 * length, 0.5 * width}), pose.transform({-0.5 * length, -0.5 * width})};
}

TEST(ClearanceMeter, DistanceOfAnOutlineToAWall) {
  ClearanceMeter meter({{{0.0, 5.0}, {100.0, 5.0}}});
  EXPECT_DOUBLE_EQ(meter.clearance(box({50.0, 1.0, 0.0}, 6.0, 3.0)), 2.5);
}

TEST(ClearanceMeter, ACornerOfTheWallCountsAsWell) {
  ClearanceMeter meter({{{10.0, 10.0}, {5.0, 0.0}, {10.0, -10.0}}});
  EXPECT_DOUBLE_EQ(meter.clearance(box({0.0, 0.0, 0.0}, 6.0, 3.0)), 2.0);
}

TEST(ClearanceMeter, CrossingIsZeroAndNoWallIsInfinity) {
  EXPECT_EQ(ClearanceMeter({{{0.0, -9.0}, {0.0, 9.0}}}).clearance(box({1.0, 0.0, 0.3}, 6.0, 3.0)), 0.0);
  EXPECT_TRUE(std::isinf(ClearanceMeter({}).clearance(box({}, 6.0, 3.0))));
}

TEST(ClearanceMeter, AgreesWithTheWorldsExhaustiveSearch) {
  Random random(1000, Stream::kWander);
  std::vector<world::WallChain> walls(2);
  for (int i = 0; i < 400; ++i) {
    walls[0].emplace_back(0.5 * i, 3.0 + 0.3 * random.normal());
    walls[1].emplace_back(0.5 * i, -3.0 + 0.3 * random.normal());
  }
  ClearanceMeter meter(walls);
  for (int i = 0; i < 500; ++i) {
    const auto outline = box(
        {random.uniform(0.0, 200.0), random.uniform(-2.5, 2.5), random.uniform(-3.0, 3.0)}, 6.0, 3.0);
    EXPECT_NEAR(meter.clearance(outline), world::clearance(outline, walls), 1e-9);
  }
}

}  // namespace
}  // namespace tunnel_pilot::simulation
