#include "tunnel_pilot/geometry/tick_time.h"

#include <gtest/gtest.h>

namespace tunnel_pilot {
namespace {

using std::chrono::milliseconds;

class TickTimeTest : public ::testing::Test {
 protected:
  /// What `steps` of the clock [ms] add, after a second in steps of 10 ms.
  Stamp after(std::initializer_list<int> steps) {
    TickTime time;
    Stamp clock = std::chrono::hours(1);
    for (int i = 0; i < 100; ++i) time.tick(clock += milliseconds(10));
    const Stamp before = time.now();
    for (const int step : steps) time.tick(clock += milliseconds(step));
    return time.now() - before;
  }
};

TEST_F(TickTimeTest, BeginsAtZeroWithAStepThatCountsAsNone) {
  TickTime time;
  time.tick(std::chrono::hours(1));
  time.tick(std::chrono::hours(2));
  EXPECT_EQ(time.now(), Stamp::zero());
}

TEST_F(TickTimeTest, EvenStepsCountInFull) { EXPECT_EQ(after({10, 10, 10}), milliseconds(30)); }

TEST_F(TickTimeTest, CallsInBetweenCountInFull) {
  EXPECT_EQ(after({3, 7, 10, 1, 1, 8, 10}), milliseconds(40));
}

TEST_F(TickTimeTest, AJumpAheadCountsAsTheLongestStepBeforeIt) {
  EXPECT_EQ(after({3600000}), milliseconds(10));
  EXPECT_EQ(after({12}), milliseconds(10));
  EXPECT_EQ(after({3, 3600000}), milliseconds(13));
}

TEST_F(TickTimeTest, AJumpBackCountsAsNoneAndTheStepsAfterItInFull) {
  EXPECT_EQ(after({-3600000, 10, 10}), milliseconds(20));
}

TEST_F(TickTimeTest, AnotherRhythmCountsInFullFromItsSecondStep) {
  EXPECT_EQ(after({20, 20, 20}), milliseconds(50));
  EXPECT_EQ(after({5, 5, 5}), milliseconds(15));
}

TEST_F(TickTimeTest, ARhythmSlowerThan25MillisecondsCountsAsThat) {
  EXPECT_EQ(after({40, 40, 40}), milliseconds(60));
}

TEST_F(TickTimeTest, AJumpIsForgottenAfterEightSteps) {
  EXPECT_EQ(after({3600000, 10, 10, 10, 10, 10, 10, 10, 10, 3600000}), milliseconds(100));
}

}  // namespace
}  // namespace tunnel_pilot
