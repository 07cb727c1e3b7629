#include "tunnel_pilot/vehicle/articulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "truck_file.h"

namespace tunnel_pilot::vehicle {
namespace {

TEST(Articulation, PapersSteadyTurnHasRadius24Metres) {
  const TruckGeometry truck = shippedTruck().geometry;
  EXPECT_NEAR(1.0 / steadyCurvature(truck, 12.0 * kDegree), 24.4, 0.05);
  EXPECT_NEAR(yawRate(truck, 3.0, 12.0 * kDegree, 0.0), 7.05 * kDegree, 0.02 * kDegree);
}

TEST(Articulation, PositiveTurnsLeftAndIsMirrored) {
  const TruckGeometry truck = shippedTruck().geometry;
  EXPECT_GT(yawRate(truck, 3.0, 0.2, 0.0), 0.0);
  EXPECT_DOUBLE_EQ(yawRate(truck, 3.0, -0.2, 0.1), -yawRate(truck, 3.0, 0.2, -0.1));
}

TEST(Articulation, StandingTruckTurnsItsFrontByTheRearsShare) {
  const TruckGeometry truck = shippedTruck().geometry;
  EXPECT_DOUBLE_EQ(yawRate(truck, 0.0, 0.0, 0.2), 0.2 * 3.17 / 5.12);
}

TEST(Articulation, SteadyArticulationInvertsSteadyCurvature) {
  for (const TruckGeometry& truck : {shippedTruck().geometry, symmetricTruck().geometry}) {
    for (double gamma = -0.78; gamma < 0.78; gamma += 0.06) {
      EXPECT_NEAR(steadyArticulation(truck, steadyCurvature(truck, gamma)), gamma, 1e-12);
    }
  }
}

TEST(Articulation, TooTightACurvatureIsLimitedToTheStop) {
  const TruckGeometry truck = shippedTruck().geometry;
  EXPECT_DOUBLE_EQ(steadyArticulation(truck, 1.0), truck.max_articulation);
  EXPECT_DOUBLE_EQ(steadyArticulation(truck, -1e6), -truck.max_articulation);
}

TEST(Articulation, SlopeVanishesInSteadyTurning) {
  const TruckGeometry truck = shippedTruck().geometry;
  EXPECT_NEAR(articulationSlope(truck, steadyCurvature(truck, 0.3), 0.3), 0.0, 1e-15);
}

// Driving d(gamma)/ds must give the yaw rate of the wanted curvature, whatever the articulation.
TEST(Articulation, SlopeMakesTheFrontAxleFollowTheCurvature) {
  for (const TruckGeometry& truck : {shippedTruck().geometry, symmetricTruck().geometry}) {
    const double slope = articulationSlope(truck, 0.05, 0.1);
    EXPECT_NEAR(yawRate(truck, 3.0, 0.1, 3.0 * slope), 3.0 * 0.05, 1e-12);
  }
}

TEST(Articulation, RearAxleLiesBehindTheHinge) {
  const TruckGeometry truck = shippedTruck().geometry;
  const geometry::Pose straight = rearPose(truck, {1.0, 2.0, 0.0}, 0.0);
  EXPECT_NEAR(straight.x, 1.0 - 5.12, 1e-12);
  EXPECT_NEAR(straight.y, 2.0, 1e-12);
  // In a left turn the hinge stays on the front body and the rear axle swings out to the left.
  const geometry::Pose turned = rearPose(truck, {}, M_PI / 4);
  EXPECT_NEAR(turned.heading, -M_PI / 4, 1e-12);
  EXPECT_NEAR(turned.x, -1.95 - 3.17 * std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(turned.y, 3.17 * std::sqrt(0.5), 1e-12);
}

double signedArea(const std::vector<geometry::Point>& p) {
  double area = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const geometry::Point& a = p[i];
    const geometry::Point& b = p[(i + 1) % p.size()];
    area += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  return area;
}

TEST(Articulation, OutlinesAreCounterClockwiseAndOfTheTrucksSize) {
  const TruckGeometry truck = shippedTruck().geometry;
  const geometry::Pose pose{5.0, -3.0, 2.0};
  EXPECT_NEAR(signedArea(frontOutline(truck, pose)), 3.05 * (1.6 + 1.95), 1e-9);
  EXPECT_NEAR(signedArea(rearOutline(truck, pose, 0.5)), 3.05 * (1.9 + 3.17), 1e-9);
}

// On a 12 m bend driven with the front axle in the middle of a 5 m drift, 0.71 m remain inside.
TEST(Articulation, InsideClearanceOfATwelveMetreBend) {
  const TruckGeometry truck = shippedTruck().geometry;
  const double gamma = steadyArticulation(truck, 1.0 / 12.0);
  double innermost = 12.0;
  for (const geometry::Point& corner : rearOutline(truck, {}, gamma)) {
    innermost = std::min(innermost, (corner - geometry::Point(0.0, 12.0)).norm());
  }
  const geometry::Point beside_axle = rearPose(truck, {}, gamma).transform({0.0, 0.5 * 3.05});
  innermost = std::min(innermost, (beside_axle - geometry::Point(0.0, 12.0)).norm());
  EXPECT_NEAR(innermost - (12.0 - 2.5), 0.71, 0.01);
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
