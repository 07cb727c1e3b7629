#include "tunnel_pilot/learning/demonstration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::learning {
namespace {

constexpr double kSpeed = 3.0;  // [m/s]

const vehicle::TruckGeometry& truck() {
  static const vehicle::TruckGeometry geometry =
      vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml").geometry;
  return geometry;
}

DemonstrationParameters parameters() {
  DemonstrationParameters p{};
  p.seen_after = 0.04;
  p.acts_after = 0.165;
  p.lag = 0.26;
  p.label_after = p.seen_after + p.acts_after + p.lag;
  p.least_speed = 0.5;
  p.yaw = {0.95, 0.15, 0.003, 0.94, 100.0, 0.04, 0.15, 0.8};
  return p;
}

// A made drive: articulation and offset over time, sampled as the truck's sensors do.
struct Drive {
  std::function<double(double)> articulation = [](double) { return 0.0; };
  std::function<double(double)> offset = [](double) { return 0.0; };
  std::function<double(double)> speed = [](double) { return kSpeed; };
  double duration = 12.0;  // [s]

  std::vector<Lesson> record() const {
    Demonstration demonstration(parameters(), truck());
    for (int ms = 0; ms < static_cast<int>(1e3 * duration); ms += 10) {
      const double time = 1e-3 * ms;
      const Stamp stamp = std::chrono::milliseconds(ms);
      if (ms % 30 == 0) {
        geometry::Scan scan;
        scan.stamp = stamp;
        scan.ranges.assign(drivers::LidarInputs::kBeams, static_cast<float>(time));  // tells its time
        demonstration.addScan(scan, offset(time), 7);
      }
      if (ms % 20 != 0) continue;
      drivers::Motion motion;
      motion.stamp = stamp;
      motion.speed = speed(time);
      motion.articulation = articulation(time);
      motion.yaw_rate = 0.95 * vehicle::yawRate(truck(), motion.speed, motion.articulation, 0.0);
      demonstration.addMotion(motion);
    }
    return demonstration.take();
  }
};

double timeOf(const Lesson& lesson) { return static_cast<double>(lesson.example.ranges.front()); }

struct Gains {
  double e, eta, g;
};
Gains gains() {
  const double arm = truck().front_axle_to_hinge + truck().rear_axle_to_hinge;
  const double lambda = kSpeed * parameters().lag;
  const double length = Demonstration::kReturn;
  const double e = arm * lambda / std::pow(length, 3);
  return {e, 3.0 * arm * lambda / (length * length) - truck().rear_axle_to_hinge * e,
          3.0 * lambda / length - 1.0};
}

TEST(Demonstration, LabelsAScanWithTheArticulationAfterTheDelays) {
  Drive drive;
  drive.articulation = [](double t) { return 0.03 * t; };
  const std::vector<Lesson> lessons = drive.record();
  ASSERT_GT(lessons.size(), 300U);
  for (const Lesson& lesson : lessons) {
    const double t = timeOf(lesson);
    EXPECT_NEAR(lesson.example.articulation, 0.03 * (t + 0.04), 1e-6);
    EXPECT_NEAR(lesson.example.articulation_ahead, 0.03 * (t + 0.04 + 0.165), 1e-6);
    EXPECT_NEAR(lesson.example.label, 0.03 * (t + 0.465), 1e-6);
    EXPECT_NEAR(lesson.example.speed, kSpeed, 1e-6);
    EXPECT_EQ(lesson.example.tunnel, 7U);
  }
}

TEST(Demonstration, LearnsTheYawResponse) {
  Drive drive;
  drive.articulation = [](double) { return 0.3; };
  const Lesson last = drive.record().back();
  // A yaw rate of 0.95 of the kinematic one, shared among gain and disturbance as the observer does.
  const double arm = truck().front_axle_to_hinge * std::cos(0.3) + truck().rear_axle_to_hinge;
  const double told = static_cast<double>(last.example.yaw_gain) * std::sin(0.3) / arm +
                      static_cast<double>(last.example.yaw_disturbance);
  EXPECT_NEAR(told, 0.95 * std::sin(0.3) / arm, 1e-4);
}

TEST(Demonstration, StandstillAndReverseTeachNothing) {
  for (const double speed : {0.0, 0.3, -2.0}) {
    Drive drive;
    drive.speed = [speed](double) { return speed; };
    EXPECT_TRUE(drive.record().empty()) << speed;
  }
}

TEST(Demonstration, AGapInTheMotionTeachesNothing) {
  Demonstration demonstration(parameters(), truck());
  geometry::Scan scan;
  scan.stamp = std::chrono::milliseconds(500);
  scan.ranges.assign(drivers::LidarInputs::kBeams, 1.0F);
  for (int ms = 0; ms < 4000; ms += 20) {
    if (ms > 520 && ms < 800) continue;
    drivers::Motion motion;
    motion.stamp = std::chrono::milliseconds(ms);
    motion.speed = kSpeed;
    if (ms == 500) demonstration.addScan(scan, 0.0, 0);
    demonstration.addMotion(motion);
  }
  EXPECT_TRUE(demonstration.take().empty());
}

TEST(Demonstration, InTheMiddleOfAStraightNothingIsCorrected) {
  int corrected = 0;
  for (const Lesson& lesson : Drive().record()) {
    if (!lesson.correction) continue;
    ++corrected;
    EXPECT_NEAR(*lesson.correction, 0.0, 1e-6);
  }
  EXPECT_GT(corrected, 150);
}

TEST(Demonstration, WithoutAMeasuredTunnelThereIsNoCorrection) {
  Drive drive;
  drive.offset = [](double) { return std::numeric_limits<double>::quiet_NaN(); };
  const std::vector<Lesson> lessons = drive.record();
  EXPECT_FALSE(lessons.empty());
  for (const Lesson& lesson : lessons) EXPECT_FALSE(lesson.correction);
}

TEST(Demonstration, WhoDrivesBesideTheMiddleIsLedBack) {
  Drive drive;
  drive.offset = [](double) { return 0.3; };
  const Lesson last = drive.record().back();
  ASSERT_TRUE(last.correction);
  EXPECT_NEAR(*last.correction, -gains().e * 0.3, 1e-4);
}

// The driver steers his own waves about his own line. What he did for them goes out, what would lead
// from where he was back to the middle comes in: the truth about both is known here.
TEST(Demonstration, WhatADriverDoesForHisOwnLineGoesOut) {
  const double height = 0.2, number = 2.0 * M_PI / 30.0, shift = 0.27;  // [m 1/m m]
  const double step = 0.01;
  std::vector<double> articulation = {0.0};  // by way, exact
  for (int i = 0; i < 6000; ++i) {
    const double s = i * step;
    const double curvature = -height * number * number * std::sin(number * s);
    articulation.push_back(articulation.back() +
                           step * vehicle::articulationSlope(truck(), curvature, articulation.back()));
  }
  const auto articulationAt = [&](double t) {
    return articulation[static_cast<std::size_t>(kSpeed * t / step + 0.5)];
  };
  Drive drive;
  drive.articulation = articulationAt;
  drive.offset = [&](double t) { return shift + height * std::sin(number * kSpeed * t); };
  const double lever =
      truck().rear_axle_to_hinge / (truck().front_axle_to_hinge + truck().rear_axle_to_hinge);
  int compared = 0;
  for (const Lesson& lesson : drive.record()) {
    if (!lesson.correction || timeOf(lesson) < 7.0) continue;  // the start of g is forgotten
    ++compared;
    const double acts = timeOf(lesson) + 0.04 + 0.165;
    const double course = height * number * std::cos(number * kSpeed * acts);
    const double g = articulationAt(acts);
    const double back =
        -gains().e * drive.offset(acts) - gains().eta * (course - lever * g) - gains().g * g;
    const double label = static_cast<double>(lesson.example.label + *lesson.correction);
    EXPECT_NEAR(label, back, 0.006) << timeOf(lesson);
  }
  EXPECT_GT(compared, 50);
}

// In a steady bend, inside of the middle: the way in the middle is wider.
TEST(Demonstration, TheTighterWayInsideOfABendIsAllowedFor) {
  const double curvature = 1.0 / 15.0, inside = 0.4;
  Drive drive;
  drive.offset = [&](double) { return inside; };
  drive.articulation = [&](double) {
    return vehicle::steadyArticulation(truck(), curvature / (1.0 - curvature * inside));
  };
  const Lesson last = drive.record().back();
  ASSERT_TRUE(last.correction);
  const double arm = truck().front_axle_to_hinge + truck().rear_axle_to_hinge;
  const double g = last.example.label - vehicle::steadyArticulation(truck(), curvature);
  const double back =
      -gains().e * inside + (gains().eta * truck().rear_axle_to_hinge / arm - gains().g) * g;
  EXPECT_GT(g, 0.005);
  EXPECT_NEAR(*last.correction, back - g, 0.15 * g);
}

}  // namespace
}  // namespace tunnel_pilot::learning
