#include "tunnel_pilot/drivers/yaw_observer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr YawObserverParameters kParameters{1.0, 0.15, 0.003, 0.94, 100.0, 0.03, 0.15, 0.8};

vehicle::TruckGeometry geometryOfTruck() {
  return vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml").geometry;
}

// Drives slow sine bends with a truck of gain `gain` and disturbance `disturbance`.
YawResponse learned(double gain, double disturbance, double speed, double bends) {
  const vehicle::TruckGeometry truck = geometryOfTruck();
  YawObserver observer(kParameters, truck);
  for (int i = 0; i < 2000; ++i) {
    const double time = 0.0286 * i;
    Motion motion;
    motion.speed = speed;
    motion.articulation = bends * std::sin(0.3 * time);
    motion.articulation_rate = bends * 0.3 * std::cos(0.3 * time);
    motion.yaw_rate = kParameters.hinge_share *
                          vehicle::yawRate(truck, 0.0, motion.articulation, motion.articulation_rate) +
                      gain * vehicle::yawRate(truck, speed, motion.articulation, 0.0) +
                      speed * disturbance;
    observer.update(motion, 0.0286);
  }
  return observer.response();
}

TEST(YawObserver, LearnsGainAndDisturbanceInBends) {
  const YawResponse response = learned(0.85, 0.002, 3.0, 0.3);
  EXPECT_NEAR(response.gain, 0.85, 0.01);
  EXPECT_NEAR(response.disturbance, 0.002, 3e-4);
}

TEST(YawObserver, KnowsTheGainBeforeAReturnTurnsBack) {
  // Turning in for 2 s at full rate, as after a wrong heading; the hinge's share is not the truck's
  // gain.
  const vehicle::TruckGeometry truck = geometryOfTruck();
  YawObserver observer(kParameters, truck);
  for (int i = 0; i < 100; ++i) {
    Motion motion;
    motion.speed = 2.0;
    motion.articulation_rate = 0.26;
    motion.articulation = 0.26 * 0.02 * i;
    motion.yaw_rate = 1.15 * vehicle::yawRate(truck, motion.speed, motion.articulation, 0.0) +
                      0.94 * vehicle::yawRate(truck, 0.0, motion.articulation, 0.26);
    observer.update(motion, 0.02);
  }
  EXPECT_NEAR(observer.response().gain, 1.15, 0.03);
}

TEST(YawObserver, KeepsThePriorGainWhereNothingExcitesIt) {
  EXPECT_NEAR(learned(0.85, 0.0, 3.0, 0.0).gain, 1.0, 1e-6);
}

TEST(YawObserver, LearnsNothingAtCreepingSpeed) {
  const YawResponse response = learned(0.85, 0.002, 0.5, 0.3);
  EXPECT_EQ(response.gain, 1.0);
  EXPECT_EQ(response.disturbance, 0.0);
}

TEST(YawObserver, StaysWithinTwiceTheDeviationWhateverItIsTold) {
  const YawResponse response = learned(5.0, 0.5, 3.0, 0.3);
  EXPECT_LE(response.gain, 1.0 + 2.0 * kParameters.gain_deviation + 1e-12);
  EXPECT_LE(response.disturbance, 2.0 * kParameters.disturbance_deviation + 1e-12);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
