#include "tunnel_pilot/simulation/fastest_return.h"

#include <gtest/gtest.h>

#include <string>
#include <variant>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kMostOvershoot = 0.05;  // [m]

// The kinematic truck: the same steering, and soon driven.
FastestReturn found(double steering_rate) {
  const Scenario scenario =
      loadScenario(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/scenarios/return_away.yaml");
  Setup setup = loadSetup(scenario);
  setup.pilot.bridge.steering_rate = steering_rate;
  PlantChoice plant = scenario.plant;
  plant.model = PlantModel::kKinematic;
  return fastestReturn(std::get<DriveExperiment>(scenario.experiment), plant, setup, 1, kMostOvershoot);
}

TEST(FastestReturn, IsWithinTheOvershootAndTakesLongerWhereTheSteeringTurnsMoreSlowly) {
  const FastestReturn best = found(0.2618);
  EXPECT_LT(best.overshoot, kMostOvershoot + 0.003);
  EXPECT_LT(best.settle_time, 5.5);                           // faster than any driver of the package
  EXPECT_GT(best.settle_time, 2.0 * best.heading_zero_time);  // back is no shorter than out
  EXPECT_LT(best.heading_zero_time, 2.1);
  EXPECT_GT(found(0.2).settle_time, best.settle_time + 0.3);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
