#include "tunnel_pilot/supervision/steering_monitor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/vehicle/dynamic_truck.h"

namespace tunnel_pilot::supervision {
namespace {

constexpr double kTolerance = 0.0873;  // [rad] 5 deg
constexpr double kTime = 0.5;          // [s]

vehicle::TruckParameters truck() {
  return vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml");
}

TEST(SteeringMonitor, AHealthyTruckThatRampsAtFullRateIsNoFault) {
  vehicle::DynamicTruck plant(truck(), {});
  plant.reset({}, 0.0, 3.0);
  SteeringMonitor monitor(truck().steering, kTolerance, kTime);
  monitor.start(0.0, Stamp(0));
  double command = 0.0;
  for (int i = 1; i < 8000; ++i) {
    const double target = (i / 2000) % 2 == 0 ? 0.4 : -0.4;
    command += std::clamp(target - command, -0.000262, 0.000262);
    plant.step({command, 3.0 - plant.state().speed}, {}, 0.001);
    if (i % 20 != 0) continue;
    monitor.update(command, plant.state().articulation, plant.state().speed, fromSeconds(0.001 * i));
    ASSERT_FALSE(monitor.failed()) << i;
  }
}

TEST(SteeringMonitor, AWeakPumpIsSlowButNoFault) {
  SteeringMonitor monitor(truck().steering, kTolerance, kTime);
  monitor.start(-0.5, Stamp(0));
  double measured = -0.5;
  for (int i = 1; i < 400; ++i) {
    if (i > 10) measured += std::clamp(0.5 - measured, 0.0, 0.2 * 0.02);  // 11.5 deg/s
    monitor.update(0.5, measured, 3.0, fromSeconds(0.02 * i));
    ASSERT_FALSE(monitor.failed()) << 0.02 * i;
  }
}

TEST(SteeringMonitor, ATruckThatTurnsTheOtherWayIsTold) {
  SteeringMonitor monitor(truck().steering, kTolerance, kTime);
  monitor.start(0.0, Stamp(0));
  for (int i = 1; i < 100; ++i) monitor.update(0.3, -0.003 * i, 3.0, fromSeconds(0.02 * i));
  EXPECT_TRUE(monitor.failed());
}

TEST(SteeringMonitor, AStuckValveIsTold) {
  SteeringMonitor monitor(truck().steering, kTolerance, kTime);
  monitor.start(0.0, Stamp(0));
  double failed_at = 0.0;
  for (int i = 1; i < 200 && failed_at == 0.0; ++i) {
    const double command = std::min(0.3, 0.26 * 0.02 * i);
    monitor.update(command, 0.0, 3.0, fromSeconds(0.02 * i));
    if (monitor.failed()) failed_at = 0.02 * i;
  }
  // The weakest pump has 5 deg after 0.77 s (dead time, lag, 9 deg/s), the fault is told 0.5 s later.
  EXPECT_NEAR(failed_at, 1.28, 0.06);
}

TEST(SteeringMonitor, AShortDeviationIsForgiven) {
  SteeringMonitor monitor(truck().steering, kTolerance, kTime);
  monitor.start(0.0, Stamp(0));
  for (int i = 1; i < 500; ++i) {
    const double measured = i % 50 < 20 ? 0.2 : 0.0;  // 0.4 s of every second
    monitor.update(0.0, measured, 3.0, fromSeconds(0.02 * i));
    ASSERT_FALSE(monitor.failed());
  }
}

}  // namespace
}  // namespace tunnel_pilot::supervision
