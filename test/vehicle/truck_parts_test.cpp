// The dynamic truck's parts, each on its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <stdexcept>

#include "truck_file.h"
#include "tunnel_pilot/vehicle/axle_tyre.h"
#include "tunnel_pilot/vehicle/drive_train.h"
#include "tunnel_pilot/vehicle/hinge_compliance.h"
#include "tunnel_pilot/vehicle/hydraulic_actuator.h"
#include "tunnel_pilot/vehicle/quarter_truck.h"
#include "tunnel_pilot/vehicle/truck_variation.h"

namespace tunnel_pilot::vehicle {
namespace {

constexpr double kStep = 0.001;  // [s]

HydraulicActuator actuator() {
  const TruckParameters truck = shippedTruck();
  return HydraulicActuator(truck.steering, truck.geometry.max_articulation);
}

TEST(HydraulicActuator, NothingMovesBeforeTheDeadTime) {
  HydraulicActuator a = actuator();
  a.reset(0.1);
  for (int i = 0; i < 150; ++i) a.step(0.5, 3.0, kStep);
  EXPECT_EQ(a.angle(), 0.1);
  a.step(0.5, 3.0, kStep);
  EXPECT_GT(a.angle(), 0.1);
}

TEST(HydraulicActuator, DeadTimeDoesNotDependOnTheStep) {
  for (const double step : {0.0001, 0.0003, 0.0007, 0.001}) {
    HydraulicActuator a = actuator();
    a.reset(0.0);
    double time = 0.0;
    for (; a.angle() == 0.0 && time < 1.0; time += step) a.step(0.5, 3.0, step);
    EXPECT_NEAR(time, 0.15, 0.0021) << step;
  }
}

TEST(HydraulicActuator, DemandInsideTheDeadBandIsLost) {
  HydraulicActuator a = actuator();
  a.reset(0.0);
  for (int i = 0; i < 2000; ++i) a.step(0.14 * kDegree, 3.0, kStep);
  EXPECT_EQ(a.angle(), 0.0);
  for (int i = 0; i < 3000; ++i) a.step(0.16 * kDegree, 3.0, kStep);
  EXPECT_GT(a.angle(), 0.005 * kDegree);
}

TEST(HydraulicActuator, ReversalLosesTheWholeDeadBand) {
  HydraulicActuator a = actuator();
  a.reset(0.0);
  for (int i = 0; i < 4000; ++i) a.step(5.0 * kDegree, 3.0, kStep);
  const double up = a.angle();
  for (int i = 0; i < 4000; ++i) a.step(4.8 * kDegree, 3.0, kStep);
  EXPECT_NEAR(a.angle(), up, 1e-6);
  for (int i = 0; i < 4000; ++i) a.step(4.6 * kDegree, 3.0, kStep);
  EXPECT_NEAR(a.angle(), up - 0.1 * kDegree, 1e-6);
}

TEST(HydraulicActuator, FlowLimitRisesFromIdleToWorkingSpeed) {
  for (const auto& [speed, rate] : {std::pair{0.0, 9.0}, std::pair{0.5, 12.0}, std::pair{3.0, 15.0}}) {
    HydraulicActuator a = actuator();
    a.reset(-0.7);
    double highest = 0.0;
    for (int i = 0; i < 2500; ++i) {
      a.step(0.7, speed, kStep);
      highest = std::max(highest, a.rate());
    }
    EXPECT_NEAR(highest, rate * kDegree, 0.01 * kDegree);
  }
}

AxleTyre tyre(double load) { return AxleTyre(shippedTruck().tyre, load); }

// Lateral force after `seconds` at steady slip.
double lateralForce(double speed, double slip, double load, double seconds = 5.0, double drive = 0.0) {
  AxleTyre t = tyre(load);
  double force = 0.0;
  for (int i = 0; i * kStep < seconds; ++i) {
    force = t.step(speed, slip * speed, load, 1.0, 0.0, drive, kStep).across;
  }
  return force;
}

TEST(AxleTyre, SmallSlipGivesTheCorneringStiffness) {
  EXPECT_NEAR(lateralForce(5.0, 0.001, 3e5), -5.0 * 3e5 * 0.001, 0.01 * 1500.0);
}

TEST(AxleTyre, LargeSlipSaturatesAtTheFriction) {
  EXPECT_NEAR(lateralForce(5.0, 0.5, 3e5), -0.6 * 3e5, 1.0);
  // Brush tyre at a third of full sliding (tan alpha = mu / C here): 1 - (2/3)^3 of the friction.
  EXPECT_NEAR(lateralForce(5.0, 0.12, 3e5), -0.6 * 3e5 * (1.0 - 8.0 / 27.0), 100.0);
}

TEST(AxleTyre, ForceBuildsUpOverTheRelaxationLength) {
  const double steady = lateralForce(4.0, 0.001, 3e5);
  EXPECT_NEAR(lateralForce(4.0, 0.001, 3e5, 0.8 / 4.0) / steady, 1.0 - std::exp(-1.0), 0.01);
}

TEST(AxleTyre, DrivingTakesAwayLateralGrip) {
  const double drive = 0.5 * 0.6 * 3e5;
  EXPECT_NEAR(lateralForce(5.0, 0.5, 3e5, 5.0, drive), -std::sqrt(0.75) * 0.6 * 3e5, 10.0);
}

TEST(AxleTyre, WithoutLoadThereIsNoForce) {
  AxleTyre t = tyre(3e5);
  const AxleTyre::Force force = t.step(5.0, 0.5, 0.0, 1.0, 1e5, 1e5, kStep);
  EXPECT_EQ(force.along, 0.0);
  EXPECT_EQ(force.across, 0.0);
}

TEST(AxleTyre, BrakeIsNoStrongerThanTheGrip) {
  AxleTyre t = tyre(3e5);
  double force = 0.0;
  for (int i = 0; i < 1000; ++i) force = t.step(5.0, 0.0, 3e5, 0.5, 1e6, 0.0, kStep).along;
  EXPECT_NEAR(force, -0.95 * 0.5 * 0.6 * 3e5, 1e-6);
}

TEST(AxleTyre, ReleasedBrakeLetsGoAtOnce) {
  AxleTyre t = tyre(3e5);
  for (int i = 0; i < 1000; ++i) t.step(1.0, 0.0, 3e5, 1.0, 1e5, 0.0, kStep);
  EXPECT_NEAR(t.step(1.0, 0.0, 3e5, 1.0, 1e5, 0.0, kStep).along, -1e5, 1e-6);
  EXPECT_NEAR(t.step(1.0, 0.0, 3e5, 1.0, 1e3, 0.0, kStep).along, -1e3, 1e-6);
}

TEST(DriveTrain, OneStopWarmsTheBrakesByTheTrucksEnergy) {
  DriveTrain train(shippedTruck(), Load::kLoaded);
  train.reset(0.0);
  double speed = 9.0;
  double work = 0.0;
  while (speed > 0.0) {
    train.step(-2.0, speed, kStep);
    work += train.brakeForce() * speed * kStep;
    speed -= train.brakeForce() / 63800.0 * kStep;
  }
  EXPECT_NEAR(work, 0.5 * 63800.0 * 81.0, 0.01 * work);
  EXPECT_NEAR(train.brakeTemperature(), work / 3e5, 0.1);
}

TEST(DriveTrain, BrakesCoolDownAgain) {
  DriveTrain train(shippedTruck(), Load::kLoaded);
  train.reset(100.0);
  for (int i = 0; i < 600000; ++i) train.step(0.0, 3.0, kStep);
  EXPECT_NEAR(train.brakeTemperature(), 100.0 * std::exp(-1.0), 0.1);
}

TEST(DriveTrain, EmptyTruckIsAskedForLessForce) {
  DriveTrain loaded(shippedTruck(), Load::kLoaded);
  DriveTrain empty(shippedTruck(), Load::kEmpty);
  for (int i = 0; i < 5000; ++i) {
    loaded.step(-1.0, 3.0, kStep);
    empty.step(-1.0, 3.0, kStep);
  }
  EXPECT_NEAR(loaded.brakeForce(), 63800.0, 1.0);
  EXPECT_NEAR(empty.brakeForce(), 28800.0, 1.0);
}

TEST(QuarterTruck, SettlesUnderAShiftedLoad) {
  const TruckParameters truck = shippedTruck();
  QuarterTruck axle(truck.front_suspension, 3e5);
  axle.reset(0.0);
  for (int i = 0; i < 10000; ++i) axle.step(0.0, 5e4, kStep);
  EXPECT_NEAR(axle.load(), 3.5e5, 1.0);
  EXPECT_NEAR(axle.bodyHeight(), -5e4 / 2.4e6 - 5e4 / 6.4e6, 1e-6);
}

TEST(QuarterTruck, WheelLeavesTheGroundOverADropButNeverPulls) {
  const TruckParameters truck = shippedTruck();
  QuarterTruck axle(truck.front_suspension, 3e5);
  axle.reset(0.3);
  double lowest = 1e9;
  for (int i = 0; i < 500; ++i) {
    axle.step(0.0, 0.0, kStep);
    lowest = std::min(lowest, axle.load());
  }
  EXPECT_EQ(lowest, 0.0);
}

TEST(HingeCompliance, ImpossibleModeIsRefusedInTheTruckFile) {
  YAML::Node yaml = YAML::LoadFile(truckFile());
  yaml["steering"]["compliance_damping"] = 0.02;
  try {
    loadTruck(config::Node(yaml, "truck.yaml"));
    FAIL();
  } catch (const config::ConfigError& e) {
    EXPECT_NE(std::string(e.what()).find("truck.yaml: 'steering' cannot be: no hinge spring"),
              std::string::npos);
  }
}

TEST(TruckVariation, SameSeedSameTruck) {
  const TruckParameters truck = shippedTruck();
  EXPECT_EQ(varied(truck, 3, 0.2).loaded.rear, varied(truck, 3, 0.2).loaded.rear);
  EXPECT_NE(varied(truck, 3, 0.2).loaded.rear, varied(truck, 4, 0.2).loaded.rear);
}

TEST(TruckVariation, NoFractionNoChange) {
  const TruckParameters truck = shippedTruck();
  EXPECT_EQ(varied(truck, 3, 0.0).tyre.cornering_coefficient, truck.tyre.cornering_coefficient);
  EXPECT_EQ(varied(truck, 3, 0.0).loaded.front_inertia, truck.loaded.front_inertia);
}

TEST(TruckVariation, FillsItsRangeAndNoMore) {
  const TruckParameters truck = shippedTruck();
  const std::vector<std::function<double(const TruckParameters&)>> plant = {
      [](const TruckParameters& t) { return t.tyre.cornering_coefficient; },
      [](const TruckParameters& t) { return t.tyre.friction; },
      [](const TruckParameters& t) { return t.tyre.yaw_gain; },
      [](const TruckParameters& t) { return t.loaded.front; },
      [](const TruckParameters& t) { return t.loaded.rear_inertia; },
      [](const TruckParameters& t) { return t.steering.dead_time; },
      [](const TruckParameters& t) { return t.steering.max_rate; },
      [](const TruckParameters& t) { return t.steering.lag; },
      [](const TruckParameters& t) { return t.drive.brake_deceleration; }};
  for (const auto& value : plant) {
    double lowest = 10.0;
    double highest = 0.0;
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      const double factor = value(varied(truck, seed, 0.2)) / value(truck);
      lowest = std::min(lowest, factor);
      highest = std::max(highest, factor);
    }
    EXPECT_GE(lowest, 0.8);
    EXPECT_LT(lowest, 0.82);
    EXPECT_LE(highest, 1.2);
    EXPECT_GT(highest, 1.18);
  }
}

TEST(TruckVariation, LeavesAloneWhatIsMeasuredWithATape) {
  const TruckParameters truck = shippedTruck();
  const TruckParameters other = varied(truck, 5, 0.2);
  EXPECT_EQ(other.geometry.front_axle_to_hinge, truck.geometry.front_axle_to_hinge);
  EXPECT_EQ(other.geometry.max_articulation, truck.geometry.max_articulation);
  EXPECT_EQ(other.loaded.front_cg_offset, truck.loaded.front_cg_offset);
  EXPECT_EQ(other.drive.max_speed, truck.drive.max_speed);
}

TEST(TruckVariation, IdleStaysTheSameShareOfTheFlow) {
  const TruckParameters truck = shippedTruck();
  const TruckParameters other = varied(truck, 5, 0.2);
  EXPECT_NEAR(other.steering.idle_rate / other.steering.max_rate,
              truck.steering.idle_rate / truck.steering.max_rate, 1e-12);
}

TEST(TruckVariation, EveryTruckOfTheRobustnessRunsHasASnakingMode) {
  const TruckParameters truck = shippedTruck();
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    EXPECT_NO_THROW(hingeCompliance(varied(truck, seed, 0.2))) << seed;
  }
}

TEST(TruckVariation, FractionOutOfRangeIsRefused) {
  EXPECT_THROW(varied(shippedTruck(), 1, -0.1), std::invalid_argument);
  EXPECT_THROW(varied(shippedTruck(), 1, 0.5), std::invalid_argument);
  EXPECT_THROW(varied(shippedTruck(), 1, std::nan("")), std::invalid_argument);
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
