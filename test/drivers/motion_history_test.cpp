#include "tunnel_pilot/drivers/motion_history.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
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

TEST(MotionHistory, KeepsTheLastSecondsWhenItsRingHasGoneRound) {
  MotionHistory history;
  for (int i = 0; i < 500; ++i) history.add(at(0.02 * i, 0.04 * i), kLater);
  const auto pose = history.poseAt(fromSeconds(9.51));
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->x, 19.02, 1e-9);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
