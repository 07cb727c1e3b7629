#include "tunnel_pilot/drivers/motion_history.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <random>
#include <vector>

namespace tunnel_pilot::drivers {
namespace {

constexpr Stamp kLater = std::chrono::seconds(100);

Motion at(double time, double x, double heading = 0.0) {
  Motion motion;
  motion.stamp = fromSeconds(time);
  motion.pose = {x, 0.0, heading};
  motion.speed = 2.0;
  motion.yaw_rate = 0.5;
  return motion;
}

TEST(MotionHistory, HasNoPoseBeforeAnyMotion) { EXPECT_FALSE(MotionHistory().poseAt(fromSeconds(1.0))); }

TEST(MotionHistory, InterpolatesBetweenSamples) {
  MotionHistory history;
  history.add(at(1.0, 0.0), kLater);
  history.add(at(1.1, 0.2), kLater);
  ASSERT_TRUE(history.poseAt(fromSeconds(1.05)));
  EXPECT_NEAR(history.poseAt(fromSeconds(1.05))->x, 0.1, 1e-9);
}

TEST(MotionHistory, ExtrapolatesWithTheEndsSpeedAndYawRate) {
  MotionHistory history;
  history.add(at(1.0, 0.0), kLater);
  const auto pose = history.poseAt(fromSeconds(1.2));
  ASSERT_TRUE(pose);
  // An arc of 0.4 m that turns by 0.1 rad.
  EXPECT_NEAR(pose->x, 4.0 * std::sin(0.1), 1e-6);
  EXPECT_NEAR(pose->y, 4.0 * (1.0 - std::cos(0.1)), 1e-6);
  EXPECT_NEAR(pose->heading, 0.1, 1e-9);
}

TEST(MotionHistory, HasNoPoseBeyondItsReach) {
  MotionHistory history;
  history.add(at(1.0, 0.0), kLater);
  EXPECT_TRUE(history.poseAt(fromSeconds(1.29)));
  EXPECT_FALSE(history.poseAt(fromSeconds(1.31)));
  EXPECT_FALSE(history.poseAt(fromSeconds(0.69)));
}

TEST(MotionHistory, IgnoresOldAndNonFiniteMotion) {
  MotionHistory history;
  history.add(at(1.0, 0.0), kLater);
  history.add(at(0.9, 5.0), kLater);
  history.add(at(1.1, std::numeric_limits<double>::quiet_NaN()), kLater);
  EXPECT_EQ(history.latest().stamp, fromSeconds(1.0));
}

TEST(Motion, IsUsableWhileEachOfItsNumbersIsOneUpToAMillion) {
  using Number = std::function<double&(Motion&)>;
  const std::vector<Number> numbers = {[](Motion& m) -> double& { return m.pose.x; },
                                       [](Motion& m) -> double& { return m.pose.y; },
                                       [](Motion& m) -> double& { return m.pose.heading; },
                                       [](Motion& m) -> double& { return m.speed; },
                                       [](Motion& m) -> double& { return m.yaw_rate; },
                                       [](Motion& m) -> double& { return m.articulation; },
                                       [](Motion& m) -> double& { return m.articulation_rate; }};
  const auto usableWith = [&](std::size_t i, double value) {
    Motion motion = at(1.0, 0.0);
    numbers[i](motion) = value;
    return isUsable(motion);
  };
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    for (const double sign : {1.0, -1.0}) {
      EXPECT_TRUE(usableWith(i, sign * 1e6)) << i;
      for (const double beyond : {1.000001e6, 1e300, std::numeric_limits<double>::infinity(),
                                  std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_FALSE(usableWith(i, sign * beyond)) << i << " " << sign * beyond;
      }
    }
  }
}

// ---- from one pose to the next

Motion moving(double time, double speed, double yaw_rate, const geometry::Pose& pose) {
  Motion motion;
  motion.stamp = fromSeconds(time);
  motion.pose = pose;
  motion.speed = speed;
  motion.yaw_rate = yaw_rate;
  return motion;
}

// The farthest step ahead [m], and the widest turn [rad], that count as driven, to a millimetre (mrad).
double longestStep(double speed_before, double speed_after, double time) {
  double step = 0.0;
  while (leadsTo(moving(10.0, speed_before, 0.0, {}),
                 moving(10.0 + time, speed_after, 0.0, {step, 0.0, 0.0}))) {
    step += 1e-3;
  }
  return step;
}

double widestTurn(double rate_before, double rate_after, double time) {
  double turn = 0.0;
  while (leadsTo(moving(10.0, 0.0, rate_before, {}),
                 moving(10.0 + time, 0.0, rate_after, {0.0, 0.0, turn}))) {
    turn += 1e-3;
  }
  return turn;
}

TEST(LeadsTo, ATruckThatStandsStaysWhereItIsHoweverLongItWasSilent) {
  for (const double silence : {0.02, 0.3, 60.0}) {
    EXPECT_NEAR(longestStep(0.0, 0.0, silence), 0.25, 0.002) << silence;
    EXPECT_NEAR(widestTurn(0.0, 0.0, silence), 0.10, 0.002) << silence;
  }
}

TEST(LeadsTo, ATruckThatDrivesComesAsFarAsItsHigherSpeedInTheTimeAndAStampsError) {
  EXPECT_NEAR(longestStep(7.0, 7.0, 0.02), 0.25 + 7.0 * 0.07, 0.002);
  EXPECT_NEAR(longestStep(7.0, 5.0, 0.30), 0.25 + 7.0 * 0.35, 0.002);
  EXPECT_NEAR(longestStep(5.0, 7.0, 0.30), 0.25 + 7.0 * 0.35, 0.002);
  EXPECT_NEAR(longestStep(-2.0, 0.0, 0.30), 0.25 + 2.0 * 0.35, 0.002) << "backwards";
  EXPECT_NEAR(widestTurn(-0.5, 0.0, 0.30), 0.10 + 0.5 * 0.35, 0.002);
  EXPECT_NEAR(widestTurn(0.2, 0.5, 0.30), 0.10 + 0.5 * 0.35, 0.002);
}

TEST(LeadsTo, ASpeedThatNoTruckHasExcusesNoJump) {
  EXPECT_NEAR(longestStep(1e6, 0.0, 0.02), 0.25 + 15.0 * 0.07, 0.002);
  EXPECT_NEAR(widestTurn(0.0, 1e6, 0.02), 0.10 + 1.5 * 0.07, 0.002);
}

TEST(LeadsTo, AfterASecondsSilenceATruckThatGoesOnIsSomewhereElse) {
  EXPECT_NEAR(longestStep(7.0, 7.0, 1.0), 0.25 + 7.0 * 1.05, 0.002);
  EXPECT_NEAR(longestStep(7.0, 7.0, 30.0), 0.25 + 7.0 * 1.05, 0.002);
  EXPECT_NEAR(widestTurn(0.3, 0.3, 30.0), 0.10 + 0.3 * 1.05, 0.002);
}

TEST(LeadsTo, ItIsTheWayThatCountsWhereverItLeads) {
  const Motion here = moving(10.0, 0.0, 0.0, {40.0, -30.0, 3.1});
  EXPECT_TRUE(leadsTo(here, moving(10.02, 0.0, 0.0, {39.85, -29.85, 3.1})));
  EXPECT_FALSE(leadsTo(here, moving(10.02, 0.0, 0.0, {39.80, -29.80, 3.1})));
  EXPECT_TRUE(leadsTo(here, moving(10.02, 0.0, 0.0, {40.0, -30.0, -3.1}))) << "across the half turn";
}

// A truck with all that odometry may do to it: up to 25 km/h, the brakes of a stop, full lock, messages
// lost for up to a second, noise of 20 mm and half a degree, stamps off by 10 ms.
TEST(LeadsTo, NoTruckThatDrivesEverJumps) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (int drive = 0; drive < 200; ++drive) {
    Motion truth = moving(10.0, 7.0, 0.0, {200.0 * any(random), 200.0 * any(random), 3.0 * any(random)});
    Motion last = truth;
    for (int message = 0; message < 500; ++message) {
      const int lost = any(random) > 0.96 ? static_cast<int>(24.0 + 24.0 * any(random)) : 0;
      for (int i = 0; i <= lost; ++i) {
        truth.pose = advanced(truth.pose, truth.speed, truth.yaw_rate, 0.02);
        truth.speed = std::clamp(truth.speed + 0.02 * 2.5 * any(random), 0.0, 7.0);
        truth.yaw_rate = std::clamp(truth.yaw_rate + 0.04 * any(random), -0.7, 0.7);
        truth.stamp += std::chrono::milliseconds(20);
      }
      Motion told = truth;
      told.stamp += fromSeconds(0.009 * any(random));
      told.pose.x += 0.02 * noise(random);
      told.pose.y += 0.02 * noise(random);
      told.pose.heading = geometry::wrapAngle(told.pose.heading + 0.0087 * noise(random));
      told.speed *= 1.0 + 0.01 * any(random);
      ASSERT_TRUE(leadsTo(last, told)) << drive << " " << message;
      last = told;
    }
  }
}

TEST(MotionHistory, IsNotStoppedByMotionFromTheFuture) {
  MotionHistory history;
  EXPECT_TRUE(history.add(at(1.0, 0.0), fromSeconds(1.0)));
  EXPECT_FALSE(history.add(at(1.1, 9.0), fromSeconds(1.04)));
  EXPECT_FALSE(history.add(at(1e5, 9.0), fromSeconds(1.04)));
  EXPECT_TRUE(history.add(at(1.02, 0.04), fromSeconds(1.04)));
  EXPECT_EQ(history.latest().stamp, fromSeconds(1.02));
}

TEST(MotionHistory, TakesMotionAsFarAheadAsItIsTold) {
  MotionHistory history(std::chrono::milliseconds(200));
  EXPECT_TRUE(history.add(at(1.2, 0.0), fromSeconds(1.0)));
  EXPECT_FALSE(history.add(at(1.5, 0.0), fromSeconds(1.2)));
}

TEST(MotionHistory, ToldToKeepTheLatestItGoesBackFromThere) {
  MotionHistory history;
  history.keepLatest();
  EXPECT_TRUE(history.empty());
  Motion motion = at(1.0, 7.0);
  motion.yaw_rate = 0.0;
  history.add(motion, kLater);
  motion.stamp = fromSeconds(1.02);
  motion.pose.x = 100.0;
  history.add(motion, kLater);
  history.keepLatest();
  EXPECT_EQ(history.latest().pose.x, 100.0);
  EXPECT_NEAR(history.poseAt(fromSeconds(1.0))->x, 99.96, 1e-9);
}

TEST(MotionHistory, KeepsTheLastSecondsWhenItsRingHasGoneRound) {
  MotionHistory history;
  for (int i = 0; i < 500; ++i) history.add(at(0.02 * i, 0.04 * i), kLater);
  const auto pose = history.poseAt(fromSeconds(9.51));
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->x, 19.02, 1e-9);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
