#include "tunnel_pilot/drivers/articulation_profile.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

namespace tunnel_pilot::drivers {
namespace {

vehicle::TruckParameters truck() {
  return vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml");
}

TEST(ArticulationProfile, IsSteadyOnAnArc) {
  ArticulationProfile profile;
  profile.build(geometry::buildPath({{30.0, 0.08, 0.08}}, {}, 0.25), truck().geometry, 0.5);
  const double steady = vehicle::steadyArticulation(truck().geometry, 0.08);
  for (const auto& sample : profile.samples()) EXPECT_NEAR(sample.articulation, steady, 1e-3);
}

TEST(ArticulationProfile, LagsAStepOfCurvatureByTheRearLength) {
  ArticulationProfile profile;
  profile.build(geometry::buildPath({{10.0, 0.0, 0.0}, {30.0, 0.02, 0.02}}, {}, 0.1), truck().geometry,
                0.1);
  const double steady = vehicle::steadyArticulation(truck().geometry, 0.02);
  const double rear = truck().geometry.rear_axle_to_hinge;
  EXPECT_NEAR(profile.at(10.0 + rear) / steady, 1.0 - std::exp(-1.0), 0.03);
}

TEST(ArticulationProfile, KeepsTheFrontAxleOfATruckWithoutSlipOnThePath) {
  const geometry::Path path = geometry::buildPath(
      {{5.0, 0.0, 0.0}, {10.0, 0.0, 1.0 / 15.0}, {10.0, 1.0 / 15.0, 1.0 / 15.0}}, {}, 0.1);
  ArticulationProfile profile;
  profile.build(path, truck().geometry, 0.1);
  vehicle::KinematicTruck plant(truck());
  plant.reset({}, 0.0, 1.0);
  for (int i = 0; i < 24000; ++i) {
    plant.step({profile.at(0.001 * (i + 1)), 0.0}, {}, 0.001);
    const double offset = path.project(plant.state().pose.position()).lateral_offset;
    ASSERT_LT(std::abs(offset), 0.01) << i;
  }
}

TEST(ArticulationProfile, AnEmptyPathEmptiesIt) {
  ArticulationProfile profile;
  profile.build(geometry::buildPath({{10.0, 0.0, 0.0}}, {}, 0.5), truck().geometry, 0.5);
  profile.build(geometry::Path(), truck().geometry, 0.5);
  EXPECT_TRUE(profile.empty());
}

}  // namespace
}  // namespace tunnel_pilot::drivers
