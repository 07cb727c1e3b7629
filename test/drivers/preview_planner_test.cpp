#include "tunnel_pilot/drivers/preview_planner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr double kStep = 0.15;     // [s]
constexpr double kMaxRate = 0.26;  // [rad/s]

vehicle::TruckGeometry geometryOfTruck() {
  return vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml").geometry;
}

PreviewPlanner planner(double rate_share = 1.0) {
  return {
      {geometryOfTruck(), 0.2, kMaxRate, 0.75, 0.0}, {4.0, 2.0, 6.0, 3.0, 5.0, rate_share, 3.0}, kStep};
}

geometry::Path straight() { return geometry::buildPath({{60.0, 0.0, 0.0}}, {}, 0.5); }

// Settles the plan for a standing situation.
double planned(PreviewPlanner& planner, const PathState& state, const geometry::Path& path,
               double speed) {
  double rate = 0.0;
  for (int i = 0; i < 20; ++i) rate = planner.plan(state, path, speed, {}, 0.0);
  return rate;
}

TEST(PreviewPlanner, LeavesATruckOnAStraightPathAlone) {
  PreviewPlanner p = planner();
  EXPECT_NEAR(planned(p, {5.0, 0.0, 0.0, 0.0, 0.0}, straight(), 3.0), 0.0, 1e-9);
}

TEST(PreviewPlanner, SteersRightFromTheLeftOfThePath) {
  PreviewPlanner p = planner();
  EXPECT_LT(planned(p, {5.0, 0.3, 0.0, 0.0, 0.0}, straight(), 3.0), -0.01);
}

TEST(PreviewPlanner, IsAsymmetricNowhere) {
  PreviewPlanner left = planner();
  PreviewPlanner right = planner();
  EXPECT_NEAR(planned(left, {5.0, 0.3, 0.1, 0.05, 0.02}, straight(), 3.0),
              -planned(right, {5.0, -0.3, -0.1, -0.05, -0.02}, straight(), 3.0), 1e-9);
}

TEST(PreviewPlanner, NeverPlansBeyondTheRateLimit) {
  PreviewPlanner p = planner();
  for (const double offset : {-3.0, -1.0, 1.0, 3.0}) {
    EXPECT_LE(std::abs(planned(p, {5.0, offset, 0.4, 0.0, 0.0}, straight(), 4.0)), kMaxRate);
  }
}

TEST(PreviewPlanner, SteersAheadOfACurvatureStep) {
  const geometry::Path path = geometry::buildPath({{20.0, 0.0, 0.0}, {30.0, 0.08, 0.08}}, {}, 0.25);
  PreviewPlanner p = planner();
  EXPECT_NEAR(planned(p, {2.0, 0.0, 0.0, 0.0, 0.0}, path, 3.0), 0.0, 0.02);
  PathState near{18.5, 0.0, 0.0, 0.0, 0.0};
  EXPECT_GT(planned(p, near, path, 3.0), 0.05);
}

TEST(PreviewPlanner, HoldsTheSteadyArticulationOnAnArc) {
  const geometry::Path path = geometry::buildPath({{60.0, 0.08, 0.08}}, {}, 0.25);
  const double steady = vehicle::steadyArticulation(geometryOfTruck(), 0.08);
  PreviewPlanner p = planner();
  EXPECT_NEAR(planned(p, {5.0, 0.0, 0.0, steady, steady}, path, 3.0), 0.0, 0.003);
}

TEST(PreviewPlanner, ReckonsWithASlowerTruckInASharpBendAhead) {
  // A reversal that no hinge follows at 6 m/s: a plan that held that speed would cut it.
  const geometry::Path path = geometry::buildPath(
      {{20.0, 0.0, 0.0}, {8.0, 0.0, -0.083}, {14.0, -0.083, 0.083}, {20.0, 0.083, 0.083}}, {}, 0.25);
  PreviewPlanner p = planner(0.65);
  planned(p, {2.0, 0.0, 0.0, 0.0, 0.0}, path, 6.0);
  double farthest = 0.0;
  for (double t = 0.0; t < 4.8; t += 0.15) {
    farthest = std::max(farthest, std::abs(p.plannedAt(t).offset));
  }
  EXPECT_LT(farthest, 0.20);
}

TEST(PreviewPlanner, PlansWithTheRateThatItIsTold) {
  PreviewPlanner p = planner();
  p.setMaxRate(0.2);
  EXPECT_LE(std::abs(planned(p, {5.0, 3.0, 0.4, 0.0, 0.0}, straight(), 4.0)), 0.2);
}

TEST(PreviewPlanner, NeverMakesThePlanWorse) {
  // The cost after each plan, for a standing situation far from the path, falls or stays.
  PreviewPlanner p = planner();
  const PathState state{5.0, 1.5, 0.35, 0.0, 0.0};
  const geometry::Path path = straight();
  p.plan(state, path, 2.0, {}, 0.0);
  const double first = p.cost();
  double last = first;
  for (int i = 0; i < 30; ++i) {
    p.plan(state, path, 2.0, {}, 0.0);
    EXPECT_LE(p.cost(), last + 1e-12);
    last = p.cost();
  }
  EXPECT_LT(last, 0.95 * first);
}

// Turned far already on its way back to a path 1.6 m aside: a plan from a standing command is far from
// the optimum.
constexpr PathState kFarAside{5.0, -1.6, -0.09, 0.33, 0.40};

PreviewPlanner sharpPlanner() {
  return {{geometryOfTruck(), 0.26, kMaxRate, 0.75, 0.02}, {48.0, 2.0, 10.0, 3.0, 5.0, 0.8, 3.0}, kStep};
}

TEST(PreviewPlanner, TellsThePlanThatItKeeps) {
  PreviewPlanner p = sharpPlanner();
  p.setLeastCorrection(1.0);  // most sweeps are refused
  double rate = 0.0;
  for (int i = 0; i < 3; ++i) {
    rate = p.plan(kFarAside, straight(), 2.0, {0.95, 0.0}, 0.0);
    EXPECT_NEAR(p.plannedAt(kStep).command, kFarAside.command + kStep * rate, 1e-9);
  }
}

TEST(PreviewPlanner, ComesToTheSamePlanFromTwoStartsWhereSmallCorrectionsAreTried) {
  PreviewPlanner p = sharpPlanner();
  p.setLeastCorrection(0.004);
  const double standing = planned(p, kFarAside, straight(), 2.0);
  const double cost = p.cost();
  p.resetToUnwinding(kFarAside.command, 2.0);
  EXPECT_NEAR(planned(p, kFarAside, straight(), 2.0), standing, 1e-3);
  EXPECT_NEAR(p.cost(), cost, 1e-3 * cost);
  EXPECT_GT(standing, 0.9 * kMaxRate);  // it must turn on
}

TEST(PreviewPlanner, RecoversFromAStateThatIsNotANumber) {
  PreviewPlanner p = planner();
  p.plan({5.0, std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0, 0.0}, straight(), 3.0, {}, 0.03);
  EXPECT_NEAR(planned(p, {5.0, 0.0, 0.0, 0.0, 0.0}, straight(), 3.0), 0.0, 1e-9);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
