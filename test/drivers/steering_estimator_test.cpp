#include "tunnel_pilot/drivers/steering_estimator.h"

#include <gtest/gtest.h>

#include <string>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/vehicle/hydraulic_actuator.h"

namespace tunnel_pilot::drivers {
namespace {

const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";

SteeringEstimatorParameters parameters() {
  config::Node node = config::loadFile(kConfig + "lidar_driver.yaml");
  return loadSteeringEstimator(node);
}

// The hydraulics, asked for `demand` from standstill in the middle, driven at `speed` for some seconds.
double learnedRate(double flow, double demand, double speed, double seconds) {
  vehicle::TruckParameters truck = vehicle::loadTruck(kConfig + "truck.yaml");
  truck.steering.max_rate *= flow;
  vehicle::HydraulicActuator actuator(truck.steering, truck.geometry.max_articulation);
  actuator.reset(0.0);
  SteeringEstimator estimator(parameters(), truck.geometry);
  double command = 0.0;
  for (int cycle = 0; cycle < static_cast<int>(50.0 * seconds); ++cycle) {
    const Stamp now = std::chrono::milliseconds(20 * cycle);
    Motion motion;
    motion.stamp = now;
    motion.speed = speed;
    motion.articulation = actuator.angle();
    motion.articulation_rate = actuator.rate();
    estimator.observe(motion);
    command = estimator.give(demand, estimator.articulationAhead(now), now);
    for (int i = 0; i < 20; ++i) actuator.step(command, speed, 1e-3);
  }
  return estimator.maxRate() / parameters().max_rate;
}

TEST(SteeringEstimator, LearnsASlowSteeringWhereTheCommandIsOutOfReach) {
  EXPECT_NEAR(learnedRate(0.8, 0.6, 2.0, 2.5), 0.8, 0.04);
}

TEST(SteeringEstimator, BelievesAUsualSteeringToBeUsual) {
  EXPECT_NEAR(learnedRate(1.0, 0.6, 2.0, 2.0), 1.0, 0.04);
}

TEST(SteeringEstimator, ASteeringFasterThanBelievedIsNotAskedToBe) {
  EXPECT_LE(learnedRate(1.2, 0.6, 2.0, 2.0), 1.0);
}

TEST(SteeringEstimator, SmallMovementsTellNothingOfTheFastestRate) {
  EXPECT_EQ(learnedRate(0.8, 0.02, 2.0, 2.0), 1.0);
}

TEST(SteeringEstimator, AnIdlingEngineIsNotTakenForASlowSteering) {
  EXPECT_EQ(learnedRate(1.0, 0.6, 0.3, 2.0), 1.0);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
