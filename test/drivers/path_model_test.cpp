#include "tunnel_pilot/drivers/path_model.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tunnel_pilot::drivers {
namespace {

TruckResponse truck() {
  const std::string file = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml";
  return {vehicle::loadTruck(file).geometry, 0.2, 0.26, 0.75, 0.0};
}

PathState after(const PathState& state, const YawResponse& believed, double step) {
  return advancedOnPath(truck(), state, std::cos(state.heading_error), 0.0, 3.0, 0.0, believed, step,
                        lagShare(step, truck().lag));
}

TEST(PathModel, MatchesTheKinematicsOnASteadyTurn) {
  // 12 deg at 3 m/s: yaw rate 7.05 deg/s (the paper's steady turn).
  const double gamma = 12.0 * M_PI / 180.0;
  const PathState next = after({0.0, 0.0, 0.0, gamma, gamma}, {}, 0.1);
  EXPECT_NEAR(next.heading_error / 0.1 * 180.0 / M_PI, 7.05, 0.02);
}

TEST(PathModel, ATruckThatTurnsLessSlipsOutwards) {
  // With a yaw gain of 0.8 the front axle slips by 0.2 tan(gamma / 2) to the outside of the bend.
  const double gamma = 0.3;
  const PathState whole = after({0.0, 0.0, 0.0, gamma, gamma}, {1.0, 0.0}, 0.01);
  const PathState less = after({0.0, 0.0, 0.0, gamma, gamma}, {0.8, 0.0}, 0.01);
  EXPECT_NEAR(less.heading_error, 0.8 * whole.heading_error, 1e-9);
  EXPECT_NEAR(less.offset - whole.offset, -0.03 * 0.2 * std::tan(0.5 * gamma), 1e-4);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
