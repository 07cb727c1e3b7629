#include "tunnel_pilot/vehicle/dynamic_truck.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "truck_file.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/vehicle/truck_variation.h"

namespace tunnel_pilot::vehicle {
namespace {

constexpr double kStep = 0.001;  // [s]

DynamicTruckOptions onPlane(Load load = Load::kLoaded) { return {load, 0, false, 0.0}; }

double cruise(const DynamicTruck& truck, double speed) {
  return 0.2 + 2.0 * (speed - truck.state().speed);
}

// Momentum of the truck, from its masses and two reported states a step apart: independent of the
// equations of motion.
struct Momentum {
  geometry::Point velocity;  // of the common centre of gravity [m/s]
  double spin;               // angular momentum about it [kg m^2/s]
};

Momentum momentum(const TruckParameters& truck, const PlantState& before, const PlantState& after) {
  const TruckMasses& m = truck.loaded;
  const double m_all = m.front + m.rear;
  const auto front = [&](const PlantState& s) {
    return s.pose.transform({m.front_cg_offset - truck.geometry.front_axle_to_hinge, 0.0});
  };
  const auto rear = [&](const PlantState& s) {
    return rearPose(truck.geometry, s.pose, s.articulation)
        .transform({truck.geometry.rear_axle_to_hinge - m.rear_cg_offset, 0.0});
  };
  const geometry::Point front_v = (front(after) - front(before)) / kStep;
  const geometry::Point rear_v = (rear(after) - rear(before)) / kStep;
  const geometry::Point v = (m.front * front_v + m.rear * rear_v) / m_all;
  const geometry::Point arm = front(after) - rear(after);
  const geometry::Point apart = front_v - rear_v;
  const double orbit = m.front * m.rear / m_all * (arm.x() * apart.y() - arm.y() * apart.x());
  return {v, orbit + m.front_inertia * after.yaw_rate +
                 m.rear_inertia * (after.yaw_rate - after.articulation_rate)};
}

// Sliding without any grip, nothing but the hinge acts, whatever the cylinders do.
TEST(DynamicTruck, SlidingOnIceKeepsItsMomentum) {
  const TruckParameters parameters = shippedTruck();
  DynamicTruck truck(parameters, onPlane());
  truck.reset({}, 0.5, 4.0);
  PlantState before = truck.state();
  truck.step({0.5, 0.0}, {0.0, 0.0}, kStep);
  const Momentum start = momentum(parameters, before, truck.state());
  for (int i = 0; i < 5000; ++i) {
    before = truck.state();
    truck.step({i < 2000 ? -0.5 : 0.5, 0.0}, {0.0, 0.0}, kStep);
    const Momentum now = momentum(parameters, before, truck.state());
    ASSERT_LT((now.velocity - start.velocity).norm(), 2e-3) << i;
    ASSERT_NEAR(now.spin, start.spin, 2e-3 * std::abs(start.spin)) << i;
  }
}

TEST(DynamicTruck, GravityOnAGradePullsButDoesNotSpin) {
  const TruckParameters parameters = shippedTruck();
  DynamicTruck truck(parameters, onPlane());
  truck.reset({}, 0.5, 0.0);
  for (int i = 0; i < 2000; ++i) {
    const PlantState before = truck.state();
    truck.step({0.5, 0.0}, {-0.15, 0.0}, kStep);
    const Momentum now = momentum(parameters, before, truck.state());
    ASSERT_NEAR(now.spin, 0.0, 20.0) << i;
    ASSERT_NEAR(now.velocity.x(), (i + 1) * kStep * kGravity * std::sin(0.15), 2e-3) << i;
  }
}

TEST(DynamicTruck, StandsStillAfterAStopInATightTurn) {
  for (const bool rough_road : {false, true}) {
    DynamicTruck truck(shippedTruck(), {Load::kLoaded, 5, rough_road, 0.0});
    truck.reset({}, 0.6, 3.0);
    for (int i = 0; i < 6000; ++i) truck.step({0.6, -2.5}, {}, kStep);
    const geometry::Pose stopped = truck.state().pose;
    for (int i = 0; i < 10000; ++i) {
      truck.step({0.6, -2.5}, {}, kStep);
      EXPECT_LT(std::abs(truck.state().speed), 1e-4);
      EXPECT_LT(std::abs(truck.state().lateral_speed), 1e-4);
      EXPECT_LT(std::abs(truck.state().yaw_rate), 1e-4);
    }
    EXPECT_LT((truck.state().pose.position() - stopped.position()).norm(), 1e-4);
  }
}

// Chatter would show as a speed that changes its sign again and again.
TEST(DynamicTruck, ComesToRestWithoutChatter) {
  DynamicTruck truck(shippedTruck(), onPlane());
  truck.reset({}, 0.0, 3.0);
  int reversals = 0;
  double before = 1.0;
  for (int i = 0; i < 6000; ++i) {
    truck.step({0.0, -1.5}, {}, kStep);
    const double v = truck.state().speed;
    if (std::abs(v) > 1e-4 && v * before < 0.0) {
      ++reversals;
      before = v;
    }
  }
  EXPECT_LE(reversals, 3);
}

TEST(DynamicTruck, SteersOnTheSpotAtIdleRateAndStaysWhereItIs) {
  const TruckParameters parameters = shippedTruck();
  DynamicTruck truck(parameters, onPlane());
  truck.reset({}, 0.0, 0.0);
  for (int i = 0; i < 2000; ++i) truck.step({0.5, -2.0}, {}, kStep);
  EXPECT_NEAR(truck.details().actuator_articulation, 9.0 * kDegree * (2.0 - 0.35), 0.02);
  for (int i = 0; i < 6000; ++i) truck.step({0.5, -2.0}, {}, kStep);
  EXPECT_NEAR(truck.state().articulation, 0.5, 0.05);
  EXPECT_LT(std::abs(truck.state().pose.x), 0.3);
  EXPECT_LT(std::abs(truck.state().articulation_rate), 1e-3);
}

TEST(DynamicTruck, HoldsOnTheSteepestGradeBothWays) {
  for (const double grade : {-0.15, 0.15}) {
    DynamicTruck truck(shippedTruck(), onPlane());
    truck.reset({}, 0.0, 0.0);
    for (int i = 0; i < 3000; ++i) truck.step({0.0, -2.5}, {std::atan(grade), 1.0}, kStep);
    const double x = truck.state().pose.x;
    for (int i = 0; i < 10000; ++i) truck.step({0.0, -2.5}, {std::atan(grade), 1.0}, kStep);
    EXPECT_NEAR(truck.state().pose.x, x, 1e-3);
  }
}

TEST(DynamicTruck, BrakesOnTheSteepestDownhillGrade) {
  DynamicTruck truck(shippedTruck(), onPlane());
  truck.reset({}, 0.0, 5.0);
  const PlantSurroundings downhill{std::atan(-0.15), 1.0};
  for (int i = 0; i < 3000; ++i) truck.step({0.0, -2.5}, downhill, kStep);
  const double slope = truck.state().acceleration;
  // The stated 2.5 m/s^2 less gravity; the accelerometer-free longitudinal acceleration is that of
  // motion.
  EXPECT_NEAR(slope, -(2.5 - kGravity * std::sin(std::atan(0.15))), 0.05);
}

TEST(DynamicTruck, RollsBackUphillWithoutBrakes) {
  DynamicTruck truck(shippedTruck(), onPlane());
  truck.reset({}, 0.0, 0.0);
  for (int i = 0; i < 2000; ++i) truck.step({0.0, 0.0}, {std::atan(0.15), 1.0}, kStep);
  EXPECT_LT(truck.state().speed, -1.0);
}

TEST(DynamicTruck, ReachesButNeverExceedsItsTopSpeed) {
  const TruckParameters parameters = shippedTruck();
  for (const Load load : {Load::kEmpty, Load::kLoaded}) {
    DynamicTruck truck(parameters, onPlane(load));
    double highest = 0.0;
    for (int i = 0; i < 40000; ++i) {
      truck.step({0.0, 2.0}, {}, kStep);
      highest = std::max(highest, truck.state().speed);
    }
    EXPECT_LT(highest, parameters.drive.max_speed + 0.01);
    EXPECT_GT(truck.state().speed, parameters.drive.max_speed - 0.01);
  }
}

TEST(DynamicTruck, LoadedTruckAcceleratesAsStated) {
  DynamicTruck truck(shippedTruck(), onPlane());
  for (int i = 0; i < 3000; ++i) truck.step({0.0, 5.0}, {}, kStep);
  EXPECT_NEAR(truck.state().acceleration, 0.8, 0.01);
}

TEST(DynamicTruck, WetRoadLimitsLateralAcceleration) {
  const double wet = 0.35 / 0.6;
  DynamicTruck truck(shippedTruck(), onPlane());
  truck.reset({}, 0.0, 9.0);
  double sum = 0.0;
  for (int i = 0; i < 10000; ++i) {
    truck.step({0.7, cruise(truck, 9.0)}, {0.0, wet}, kStep);
    if (i >= 5000) sum += truck.state().lateral_acceleration / 5000.0;
  }
  EXPECT_LT(sum, 0.35 * kGravity);
  EXPECT_GT(sum, 0.5 * 0.35 * kGravity);
}

TEST(DynamicTruck, BrakingPressesTheFrontAxleAndPitchesTheNoseDown) {
  const TruckParameters parameters = shippedTruck();
  DynamicTruck truck(parameters, onPlane());
  truck.reset({}, 0.0, 8.0);
  for (int i = 0; i < 2500; ++i) truck.step({0.0, -2.5}, {}, kStep);
  const double transfer = 63800.0 * 2.5 * 1.9 / 5.12;
  EXPECT_NEAR(truck.details().front_load - staticAxleLoads(parameters, Load::kLoaded).front, transfer,
              0.05 * transfer);
  EXPECT_GT(truck.state().pitch, 0.2 * kDegree);
}

TEST(DynamicTruck, RoughRoadShakesLoadsAndPitchAboutTheirRest) {
  const TruckParameters parameters = shippedTruck();
  DynamicTruck truck(parameters, {Load::kLoaded, 1, true, 0.0});
  truck.reset({}, 0.0, 3.0);
  double sum = 0.0;
  double squares = 0.0;
  double pitch_squares = 0.0;
  constexpr int kSteps = 60000;
  for (int i = 0; i < kSteps; ++i) {
    truck.step({0.0, cruise(truck, 3.0)}, {}, kStep);
    sum += truck.details().front_load;
    squares += std::pow(truck.details().front_load, 2);
    pitch_squares += std::pow(truck.state().pitch, 2);
  }
  const double mean = sum / kSteps;
  const double rest = staticAxleLoads(parameters, Load::kLoaded).front;
  const double ripple = std::sqrt(squares / kSteps - mean * mean) / rest;
  EXPECT_NEAR(mean, rest, 0.02 * rest);
  EXPECT_GT(ripple, 0.05);
  EXPECT_LT(ripple, 0.30);
  const double pitch = std::sqrt(pitch_squares / kSteps);
  EXPECT_GT(pitch, 0.3 * kDegree);
  EXPECT_LT(pitch, 2.0 * kDegree);
}

TEST(DynamicTruck, MirroredSteeringGivesTheMirroredWay) {
  DynamicTruck left(shippedTruck(), {Load::kEmpty, 2, true, 0.0});
  DynamicTruck right(shippedTruck(), {Load::kEmpty, 2, true, 0.0});
  left.reset({}, 0.0, 4.0);
  right.reset({}, 0.0, 4.0);
  for (int i = 0; i < 10000; ++i) {
    const double demand = 0.3 * std::sin(0.002 * i);
    left.step({demand, 0.1}, {}, kStep);
    right.step({-demand, 0.1}, {}, kStep);
  }
  EXPECT_NEAR(left.state().pose.x, right.state().pose.x, 1e-9);
  EXPECT_NEAR(left.state().pose.y, -right.state().pose.y, 1e-9);
  EXPECT_GT(std::abs(left.state().pose.y), 0.5);
}

TEST(DynamicTruck, DirectionOfTheMapDoesNotMatter) {
  DynamicTruck east(shippedTruck(), onPlane());
  DynamicTruck turned(shippedTruck(), onPlane());
  const geometry::Pose start{10.0, -20.0, 2.8};
  east.reset({}, 0.1, 4.0);
  turned.reset(start, 0.1, 4.0);
  for (int i = 0; i < 10000; ++i) {
    east.step({0.3, 0.1}, {}, kStep);
    turned.step({0.3, 0.1}, {}, kStep);
  }
  const geometry::Pose expected = start.compose(east.state().pose);
  EXPECT_NEAR(turned.state().pose.x, expected.x, 1e-8);
  EXPECT_NEAR(turned.state().pose.y, expected.y, 1e-8);
  EXPECT_NEAR(geometry::wrapAngle(turned.state().pose.heading - expected.heading), 0.0, 1e-9);
}

TEST(DynamicTruck, ReportedRatesAreThoseOfTheReportedPose) {
  DynamicTruck truck(shippedTruck(), onPlane());
  truck.reset({}, 0.0, 4.0);
  for (int i = 0; i < 4000; ++i) {
    const PlantState before = truck.state();
    truck.step({0.4 * std::sin(0.001 * i), 0.3}, {}, kStep);
    const PlantState& after = truck.state();
    const geometry::Pose moved = before.pose.relative(after.pose);
    EXPECT_NEAR(moved.x / kStep, after.speed, 2e-3);
    EXPECT_NEAR(moved.y / kStep, after.lateral_speed, 2e-2);
    EXPECT_NEAR(moved.heading / kStep, after.yaw_rate, 1e-9);
    EXPECT_NEAR((after.articulation - before.articulation) / kStep, after.articulation_rate, 1e-9);
  }
}

// Inertial accelerations at the reference point: change of speed in axes that turn with the body.
TEST(DynamicTruck, ReportedAccelerationsAreThoseOfTheReportedSpeeds) {
  DynamicTruck truck(shippedTruck(), onPlane());
  truck.reset({}, 0.0, 4.0);
  for (int i = 0; i < 4000; ++i) {
    const PlantState before = truck.state();
    truck.step({0.4 * std::sin(0.001 * i), 0.3}, {}, kStep);
    const PlantState& after = truck.state();
    EXPECT_NEAR(after.acceleration,
                (after.speed - before.speed) / kStep - after.yaw_rate * after.lateral_speed, 0.01);
    EXPECT_NEAR(after.lateral_acceleration,
                (after.lateral_speed - before.lateral_speed) / kStep + after.yaw_rate * after.speed,
                0.01);
  }
}

TEST(DynamicTruck, YawGainScalesTheCreepingTurn) {
  for (const double gain : {0.8, 0.9, 1.2}) {
    TruckParameters parameters = shippedTruck();
    parameters.tyre.yaw_gain = gain;
    DynamicTruck truck(parameters, onPlane());
    truck.reset({}, 0.4, 1.5);
    for (int i = 0; i < 8000; ++i) truck.step({0.4, cruise(truck, 1.5)}, {}, kStep);
    const double without_slip =
        yawRate(parameters.geometry, truck.state().speed, truck.state().articulation, 0.0);
    EXPECT_NEAR(truck.state().yaw_rate / without_slip, gain, 0.02);
  }
}

TEST(DynamicTruck, MechanicalStopHolds) {
  const TruckParameters parameters = shippedTruck();
  DynamicTruck truck(parameters, onPlane());
  truck.reset({}, 0.0, 2.0);
  for (int i = 0; i < 8000; ++i) {
    truck.step({3.0, cruise(truck, 2.0)}, {}, kStep);
    EXPECT_LT(truck.state().articulation, parameters.geometry.max_articulation + 0.5 * kDegree);
  }
  EXPECT_NEAR(truck.state().articulation, parameters.geometry.max_articulation, 0.5 * kDegree);
}

TEST(DynamicTruck, LongStepsAreTheSameAsShortOnes) {
  DynamicTruck fine(shippedTruck(), onPlane());
  DynamicTruck coarse(shippedTruck(), onPlane());
  fine.reset({}, 0.0, 3.0);
  coarse.reset({}, 0.0, 3.0);
  for (int i = 0; i < 300; ++i) {
    coarse.step({0.2, 0.3}, {}, 0.01);
    for (int j = 0; j < 10; ++j) fine.step({0.2, 0.3}, {}, kStep);
  }
  EXPECT_NEAR(coarse.state().pose.x, fine.state().pose.x, 1e-6);
  EXPECT_NEAR(coarse.state().pose.y, fine.state().pose.y, 1e-6);
  EXPECT_NEAR(coarse.state().articulation, fine.state().articulation, 1e-6);
}

TEST(DynamicTruck, ResetForgetsEverything) {
  DynamicTruck used(shippedTruck(), {Load::kLoaded, 1, true, 0.0});
  for (int i = 0; i < 5000; ++i) used.step({0.5, 0.8}, {0.05, 0.7}, kStep);
  used.reset({1.0, 2.0, 0.3}, 0.1, 2.0);
  DynamicTruck fresh(shippedTruck(), {Load::kLoaded, 1, true, 0.0});
  fresh.reset({1.0, 2.0, 0.3}, 0.1, 2.0);
  for (int i = 0; i < 1000; ++i) {
    used.step({0.2, -0.5}, {}, kStep);
    fresh.step({0.2, -0.5}, {}, kStep);
  }
  EXPECT_EQ(used.state().pose.x, fresh.state().pose.x);
  EXPECT_EQ(used.state().articulation, fresh.state().articulation);
  EXPECT_EQ(used.state().pitch, fresh.state().pitch);
}

TEST(DynamicTruck, RefusesInputThatIsNotFiniteAndWrongSteps) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  DynamicTruck truck(shippedTruck(), onPlane());
  EXPECT_THROW(truck.step({nan, 0.0}, {}, kStep), std::invalid_argument);
  EXPECT_THROW(truck.step({0.0, nan}, {}, kStep), std::invalid_argument);
  EXPECT_THROW(truck.step({0.0, 0.0}, {nan, 1.0}, kStep), std::invalid_argument);
  EXPECT_THROW(truck.step({0.0, 0.0}, {}, 0.0), std::invalid_argument);
  EXPECT_THROW(truck.step({0.0, 0.0}, {}, 0.02), std::invalid_argument);
  EXPECT_THROW(truck.step({0.0, 0.0}, {}, nan), std::invalid_argument);
  EXPECT_EQ(truck.state().pose.x, 0.0);
}

// Any of the trucks that the robustness runs may draw, driven roughly, stays finite and on its wheels.
TEST(DynamicTruck, VariedTrucksStayStableUnderRoughHandling) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    DynamicTruck truck(varied(shippedTruck(), seed, 0.2),
                       {seed % 2 == 0 ? Load::kLoaded : Load::kEmpty, seed, true, 0.0});
    truck.reset({}, 0.0, 5.0);
    for (int i = 0; i < 10000; ++i) {
      const double demand = i / 1500 % 2 == 0 ? 0.7 : -0.7;
      truck.step({demand, i / 2500 % 2 == 0 ? 1.0 : -2.5}, {0.1 * std::sin(1e-3 * i), 0.6}, kStep);
      ASSERT_LT(std::abs(truck.state().articulation), 0.9);
      ASSERT_LT(std::abs(truck.state().yaw_rate), 2.0);
      ASSERT_LT(std::abs(truck.state().speed), 12.0);
    }
  }
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
