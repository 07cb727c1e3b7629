#include "tunnel_pilot/supervision/steering_monitor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tunnel_pilot/vehicle/dynamic_truck.h"

namespace tunnel_pilot::supervision {
namespace {

using std::chrono::milliseconds;

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

// -------- the answer expected, in numbers

constexpr double kCycle = 0.02;  // [s]

SteeringMonitor started(double measured = 0.0, Stamp now = Stamp(0)) {
  SteeringMonitor monitor(truck().steering, kTolerance, kTime);
  monitor.start(measured, now);
  return monitor;
}

TEST(SteeringMonitor, ExpectsTheRateThatThePumpHasAtThisSpeed) {
  const vehicle::HydraulicSteering steering = truck().steering;
  const double half = 0.5 * (steering.idle_rate + steering.max_rate);
  const std::pair<double, double> rates[] = {{0.0, steering.idle_rate},
                                             {0.5, half},
                                             {-0.5, half},
                                             {1.0, steering.max_rate},
                                             {3.0, steering.max_rate}};
  for (const auto& [speed, rate] : rates) {
    for (const double command : {0.7, -0.7}) {
      SteeringMonitor monitor = started();
      for (int i = 1; i <= 20; ++i) {
        monitor.update(command, monitor.expected(), speed, fromSeconds(kCycle * i));
        // The first command, of cycle 1, acts in cycle 9: 160 ms later.
        const double ramp = rate * kCycle * std::max(0, i - 8);
        EXPECT_NEAR(monitor.expected(), std::copysign(ramp, command), 1e-12) << speed << ", " << i;
      }
    }
  }
}

TEST(SteeringMonitor, ThePumpIsAtItsBestFromTheWorkingSpeedOn) {
  vehicle::HydraulicSteering steering = truck().steering;
  steering.working_speed = 2.0;
  steering.dead_time = 0.0;
  for (const auto& [speed, share] : {std::pair{0.5, 0.25}, {1.0, 0.5}, {2.0, 1.0}, {4.0, 1.0}}) {
    SteeringMonitor monitor(steering, kTolerance, kTime);
    monitor.start(0.0, Stamp(0));
    monitor.update(0.7, 0.0, speed, fromSeconds(kCycle));
    const double rate = steering.idle_rate + share * (steering.max_rate - steering.idle_rate);
    EXPECT_NEAR(monitor.expected(), rate * kCycle, 1e-12) << speed;
  }
}

TEST(SteeringMonitor, ExpectsASmallAngleToComeWithTheLag) {
  SteeringMonitor monitor = started();
  for (int i = 1; i <= 20; ++i) {
    monitor.update(0.01, 0.0, 3.0, fromSeconds(kCycle * i));
    const double answer = 0.01 * (1.0 - std::exp(-kCycle * std::max(0, i - 8) / truck().steering.lag));
    EXPECT_NEAR(monitor.expected(), answer, 1e-12) << i;
  }
}

TEST(SteeringMonitor, ACommandActsWhenTheDeadTimeIsJustOver) {
  SteeringMonitor monitor = started();
  for (int i = 1; i <= 3; ++i) monitor.update(0.7, 0.0, 3.0, fromSeconds(0.05 * i));
  EXPECT_EQ(monitor.expected(), 0.0);
  monitor.update(0.7, 0.0, 3.0, fromSeconds(0.20));
  EXPECT_NEAR(monitor.expected(), truck().steering.max_rate * 0.05, 1e-12);
}

TEST(SteeringMonitor, WithoutADeadTimeTheCommandActsAtOnce) {
  vehicle::HydraulicSteering steering = truck().steering;
  steering.dead_time = 0.0;
  SteeringMonitor monitor(steering, kTolerance, kTime);
  monitor.start(0.0, Stamp(0));
  monitor.update(0.7, 0.0, 3.0, fromSeconds(kCycle));
  EXPECT_NEAR(monitor.expected(), steering.max_rate * kCycle, 1e-12);
}

TEST(SteeringMonitor, ARingTooShortForTheDeadTimeGivesItsOldestCommand) {
  SteeringMonitor monitor = started();
  for (int i = 1; i <= 63; ++i) monitor.update(0.7, 0.0, 3.0, fromSeconds(1e-3 * i));
  EXPECT_EQ(monitor.expected(), 0.0);
  monitor.update(0.7, 0.0, 3.0, fromSeconds(0.064));
  EXPECT_NEAR(monitor.expected(), truck().steering.max_rate * 1e-3, 1e-12);
}

TEST(SteeringMonitor, CyclesWithoutTimeDoNotCount) {
  SteeringMonitor monitor = started();
  monitor.update(0.7, 0.0, 3.0, fromSeconds(kCycle));
  for (int i = 0; i < 100; ++i) monitor.update(-0.7, 1.0, 3.0, fromSeconds(kCycle));
  for (int i = 0; i < 100; ++i) monitor.update(-0.7, 1.0, 3.0, fromSeconds(0.5 * kCycle));
  for (int i = 2; i <= 9; ++i) monitor.update(0.7, 0.0, 3.0, fromSeconds(kCycle * i));
  EXPECT_NEAR(monitor.expected(), truck().steering.max_rate * kCycle, 1e-12);
  EXPECT_FALSE(monitor.failed());
}

TEST(SteeringMonitor, FailsOnlyAfterItsTime) {
  const Stamp start = std::chrono::seconds(100);
  SteeringMonitor monitor = started(0.0, start);
  for (int i = 1; i <= 16; ++i) monitor.update(0.0, 0.3, 3.0, start + milliseconds(30 * i));
  EXPECT_FALSE(monitor.failed()) << "0.48 s";
  monitor.update(0.0, 0.3, 3.0, start + milliseconds(510));
  EXPECT_TRUE(monitor.failed());
}

TEST(SteeringMonitor, AnErrorOfItsToleranceIsForgiven) {
  for (const double measured : {kTolerance, -kTolerance}) {
    SteeringMonitor monitor = started();
    for (int i = 1; i <= 100; ++i) monitor.update(0.0, measured, 3.0, fromSeconds(kCycle * i));
    EXPECT_FALSE(monitor.failed());
  }
}

TEST(SteeringMonitor, AStartForgetsCommandsAndErrors) {
  SteeringMonitor monitor = started();
  for (int i = 1; i <= 100; ++i) monitor.update(0.7, -0.3, 3.0, fromSeconds(kCycle * i));
  ASSERT_TRUE(monitor.failed());
  monitor.start(0.1, fromSeconds(2.0));
  EXPECT_FALSE(monitor.failed());
  for (int i = 1; i <= 100; ++i) {
    monitor.update(0.1, 0.1, 3.0, fromSeconds(2.0 + kCycle * i));
    ASSERT_NEAR(monitor.expected(), 0.1, 1e-12) << i;
  }
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
