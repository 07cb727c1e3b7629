#include "tunnel_pilot/supervision/command_limiter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::supervision {
namespace {

constexpr double kCycle = 0.02;  // [s]
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr CommandLimiterParameters kLimits{0.75, 0.26, 2.0, 9.7, 0.8, 1.2, 3.0, 2.5};

vehicle::TruckGeometry truck() {
  static const vehicle::TruckGeometry geometry =
      vehicle::loadTruck(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml").geometry;
  return geometry;
}

CommandLimiter at(double articulation, double speed) {
  CommandLimiter limiter(kLimits, truck());
  limiter.start(articulation, speed);
  return limiter;
}

double lateralAcceleration(double speed, double articulation) {
  return speed * speed * std::abs(vehicle::steadyCurvature(truck(), articulation));
}

bool any(const CommandLimiter::Flags& f) {
  return f.not_finite || f.angle || f.lateral_acceleration || f.rate || f.speed || f.acceleration ||
         f.jerk;
}

TEST(CommandLimiter, InsideAllLimitsEverythingPassesUntouched) {
  CommandLimiter limiter = at(0.1, 2.0);
  const CommandLimiter::Result result = limiter.limit({0.104, 2.0005, 2.0, false}, kCycle);
  EXPECT_EQ(result.articulation, 0.104);
  EXPECT_DOUBLE_EQ(result.speed, 2.0005);
  EXPECT_FALSE(any(result.fired));
}

TEST(CommandLimiter, ASteadyRequestStaysUntouched) {
  CommandLimiter limiter = at(0.1, 2.0);
  for (int i = 0; i < 100; ++i) {
    const CommandLimiter::Result result = limiter.limit({0.1, 2.0, 2.0, false}, kCycle);
    EXPECT_EQ(result.articulation, 0.1);
    EXPECT_EQ(result.speed, 2.0);
    EXPECT_FALSE(any(result.fired));
  }
}

TEST(CommandLimiter, AngleIsLimitedAndFlagged) {
  CommandLimiter limiter = at(0.749, 0.0);
  const CommandLimiter::Result result = limiter.limit({0.9, 0.0, 0.0, false}, kCycle);
  EXPECT_DOUBLE_EQ(result.articulation, 0.75);
  EXPECT_TRUE(result.fired.angle);
}

TEST(CommandLimiter, RateIsLimitedAndFlagged) {
  CommandLimiter limiter = at(0.0, 0.0);
  const CommandLimiter::Result result = limiter.limit({0.5, 0.0, 0.0, false}, kCycle);
  EXPECT_DOUBLE_EQ(result.articulation, 0.26 * kCycle);
  EXPECT_TRUE(result.fired.rate);
  EXPECT_FALSE(result.fired.angle);
}

TEST(CommandLimiter, ARateJustInsideIsNotFlagged) {
  CommandLimiter limiter = at(0.0, 0.0);
  EXPECT_FALSE(limiter.limit({0.259 * kCycle, 0.0, 0.0, false}, kCycle).fired.rate);
}

TEST(CommandLimiter, LateralAccelerationIsLimitedWithTheHigherOfBothSpeeds) {
  // 8 m/s allow 2/64 1/m.
  const double widest = vehicle::steadyArticulation(truck(), 2.0 / 64.0);
  CommandLimiter measured_fast = at(widest, 2.0);
  const CommandLimiter::Result result = measured_fast.limit({widest + 0.004, 2.0, 8.0, false}, kCycle);
  EXPECT_DOUBLE_EQ(result.articulation, widest);
  EXPECT_TRUE(result.fired.lateral_acceleration);
  CommandLimiter commanded_fast = at(widest, 8.0);
  EXPECT_DOUBLE_EQ(commanded_fast.limit({widest + 0.004, 8.0, 2.0, false}, kCycle).articulation, widest);
  CommandLimiter slow = at(widest, 2.0);
  EXPECT_FALSE(slow.limit({widest + 0.004, 2.0, 2.0, false}, kCycle).fired.lateral_acceleration);
}

TEST(CommandLimiter, WhereNoSpeedIsMeasuredTheCommandedOneCounts) {
  const double widest = vehicle::steadyArticulation(truck(), 2.0 / 64.0);
  CommandLimiter fast = at(widest, 8.0);
  EXPECT_DOUBLE_EQ(fast.limit({widest + 0.004, 8.0, kNaN, false}, kCycle).articulation, widest);
  CommandLimiterParameters low = kLimits;
  low.max_lateral_acceleration = 0.1;
  CommandLimiter standing(low, truck());
  standing.start(0.7, 0.0);
  EXPECT_EQ(standing.limit({0.7, 0.0, kNaN, false}, kCycle).articulation, 0.7);
  EXPECT_LT(standing.limit({0.7, 0.0, 0.9, false}, kCycle).articulation, 0.7)
      << "slow, but not standing";
}

TEST(CommandLimiter, SpeedIsLoweredForTheBendThatIsAlreadySteered) {
  CommandLimiter limiter = at(0.5, 3.0);
  CommandLimiter::Result result;
  for (int i = 0; i < 500; ++i) result = limiter.limit({0.5, 9.0, 0.0, false}, kCycle);
  EXPECT_LE(lateralAcceleration(result.speed, result.articulation), 2.0 + 1e-9);
}

TEST(CommandLimiter, AccelerationAndJerkAreLimitedOnTheWayUp) {
  CommandLimiter limiter = at(0.0, 0.0);
  double speed = 0.0;
  double acceleration = 0.0;
  for (int i = 0; i < 600; ++i) {
    const double next = limiter.limit({0.0, 5.0, speed, false}, kCycle).speed;
    const double now = (next - speed) / kCycle;
    EXPECT_LE(now, 0.8 + 1e-9);
    EXPECT_LE(std::abs(now - acceleration), 3.0 * kCycle + 1e-9);
    acceleration = now;
    speed = next;
  }
  EXPECT_NEAR(speed, 5.0, 1e-6);
}

TEST(CommandLimiter, SpeedLandsWithoutOvershoot) {
  CommandLimiter limiter = at(0.0, 0.0);
  for (int i = 0; i < 600; ++i)
    EXPECT_LE(limiter.limit({0.0, 3.0, 0.0, false}, kCycle).speed, 3.0 + 1e-9);
}

TEST(CommandLimiter, AStopAsksForNoSpeedAtOnceAndStillSteersWithinTheRate) {
  CommandLimiter limiter = at(0.2, 3.0);
  const CommandLimiter::Result result = limiter.limit({0.5, 3.0, 3.0, true}, kCycle);
  EXPECT_EQ(result.speed, 0.0);
  EXPECT_EQ(result.acceleration, kLimits.stop_deceleration);
  EXPECT_DOUBLE_EQ(result.articulation, 0.2 + 0.26 * kCycle);
}

TEST(CommandLimiter, AnAngleThatIsNoNumberHoldsTheLast) {
  CommandLimiter limiter = at(0.2, 1.0);
  for (const double bad : {kNaN, std::numeric_limits<double>::infinity()}) {
    const CommandLimiter::Result result = limiter.limit({bad, 1.0, 1.0, false}, kCycle);
    EXPECT_EQ(result.articulation, 0.2);
    EXPECT_TRUE(result.fired.not_finite);
  }
}

TEST(CommandLimiter, ASpeedThatIsNoNumberSlowsDown) {
  CommandLimiter limiter = at(0.0, 2.0);
  CommandLimiter::Result result;
  for (int i = 0; i < 200; ++i) result = limiter.limit({0.0, kNaN, 2.0, false}, kCycle);
  EXPECT_NEAR(result.speed, 0.0, 1e-6);
}

TEST(CommandLimiter, APauseAllowsTheStepOfATenthOfASecond) {
  CommandLimiter limiter = at(0.0, 0.0);
  EXPECT_DOUBLE_EQ(limiter.limit({0.7, 0.0, 0.0, false}, 10.0).articulation, 0.26 * 0.1);
}

TEST(CommandLimiter, ATimeThatDidNotPassMovesNothing) {
  for (const double elapsed : {0.0, -1.0, kNaN, std::numeric_limits<double>::infinity()}) {
    CommandLimiter limiter = at(0.2, 1.0);
    const CommandLimiter::Result result = limiter.limit({0.7, 5.0, 1.0, false}, elapsed);
    EXPECT_EQ(result.articulation, 0.2);
    EXPECT_EQ(result.speed, 1.0);
  }
}

TEST(CommandLimiter, ATimeThatDidNotPassLeavesTheAccelerationAsItIs) {
  CommandLimiter limiter = at(0.0, 2.0);
  limiter.limit({0.0, 8.0, 2.0, false}, kCycle);
  const double before = limiter.limit({0.0, 8.0, 2.0, false}, kCycle).speed;
  limiter.limit({0.0, 8.0, 2.0, false}, 0.0);
  const double acceleration = 3 * 3.0 * kCycle;  // of the third cycle at the highest jerk
  EXPECT_NEAR(limiter.limit({0.0, 8.0, 2.0, false}, kCycle).speed - before, acceleration * kCycle,
              1e-12);
}

TEST(CommandLimiter, StartsWithinTheLimits) {
  EXPECT_EQ(at(2.0, 1.0).articulation(), 0.75);
  EXPECT_EQ(at(-2.0, 1.0).articulation(), -0.75);
  EXPECT_EQ(at(0.0, 20.0).limit({0.0, 20.0, 0.0, false}, 0.0).speed, 9.7);
  EXPECT_EQ(at(0.0, -1.0).limit({0.0, 0.0, 0.0, false}, 0.0).speed, 0.0);
}

TEST(CommandLimiter, StartsWithWhatItHadWhereTheTruckTellsNoNumber) {
  CommandLimiter limiter = at(0.2, 1.0);
  limiter.start(kNaN, kNaN);
  const CommandLimiter::Result result = limiter.limit({0.2, 1.0, 1.0, false}, kCycle);
  EXPECT_EQ(result.articulation, 0.2);
  EXPECT_EQ(result.speed, 1.0);
}

TEST(CommandLimiter, StartsWithoutAcceleration) {
  CommandLimiter limiter = at(0.0, 2.0);
  for (int i = 0; i < 50; ++i) limiter.limit({0.0, 8.0, 2.0, false}, kCycle);
  limiter.start(0.0, 2.0);
  EXPECT_NEAR(limiter.limit({0.0, 8.0, 2.0, false}, kCycle).speed, 2.0 + 3.0 * kCycle * kCycle, 1e-12);
}

TEST(CommandLimiter, AStopForgetsTheAcceleration) {
  CommandLimiter limiter = at(0.0, 2.0);
  for (int i = 0; i < 50; ++i) limiter.limit({0.0, 8.0, 2.0, false}, kCycle);
  limiter.limit({0.0, 8.0, 2.0, true}, kCycle);
  EXPECT_NEAR(limiter.limit({0.0, 8.0, 2.0, false}, kCycle).speed, 3.0 * kCycle * kCycle, 1e-12);
}

TEST(CommandLimiter, TellsTheAccelerationThatTheSpeedNeeds) {
  EXPECT_EQ(at(0.0, 2.0).limit({0.0, 2.0, 2.0, false}, kCycle).acceleration, kLimits.max_acceleration);
  EXPECT_EQ(at(0.0, 2.0).limit({0.0, 3.0, 2.0, false}, kCycle).acceleration, kLimits.max_acceleration);
  EXPECT_EQ(at(0.0, 2.0).limit({0.0, 1.0, 2.0, false}, kCycle).acceleration, kLimits.max_deceleration);
}

TEST(CommandLimiter, ASpeedOutsideItsRangeIsFlagged) {
  EXPECT_TRUE(at(0.0, 9.7).limit({0.0, 9.8, 9.7, false}, kCycle).fired.speed);
  EXPECT_TRUE(at(0.0, 0.0).limit({0.0, -0.1, 0.0, false}, kCycle).fired.speed);
  EXPECT_FALSE(at(0.0, 9.7).limit({0.0, 9.7, 9.7, false}, kCycle).fired.speed);
  EXPECT_FALSE(at(0.0, 0.0).limit({0.0, 0.0, 0.0, false}, kCycle).fired.speed);
}

TEST(CommandLimiter, ASpeedThatIsNoNumberIsFlagged) {
  const CommandLimiter::Flags fired = at(0.0, 2.0).limit({0.0, kNaN, 2.0, false}, kCycle).fired;
  EXPECT_TRUE(fired.not_finite);
  EXPECT_FALSE(fired.speed);
}

TEST(CommandLimiter, TheBendsSpeedIsThatOfItsLateralAcceleration) {
  CommandLimiter limiter = at(0.5, 3.0);
  CommandLimiter::Result result;
  for (int i = 0; i < 500; ++i) result = limiter.limit({0.5, 9.0, 0.0, false}, kCycle);
  EXPECT_NEAR(lateralAcceleration(result.speed, 0.5), 2.0, 1e-6);
  EXPECT_TRUE(result.fired.lateral_acceleration);
}

TEST(CommandLimiter, BrakesUpToItsDecelerationWithinTheJerk) {
  CommandLimiter limiter = at(0.0, 8.0);
  double speed = 8.0, acceleration = 0.0, hardest = 0.0;
  for (int i = 0; i < 600; ++i) {
    const CommandLimiter::Result result = limiter.limit({0.0, 2.0, speed, false}, kCycle);
    const double now = (result.speed - speed) / kCycle;
    EXPECT_LE(std::abs(now - acceleration), 3.0 * kCycle + 1e-9);
    hardest = std::min(hardest, now);
    acceleration = now;
    speed = result.speed;
    EXPECT_GE(speed, 2.0 - 1e-9);
  }
  EXPECT_NEAR(hardest, -1.2, 1e-9);
  EXPECT_NEAR(speed, 2.0, 1e-6);
}

TEST(CommandLimiter, TheAccelerationsLimitIsFlaggedOnlyWhereItIsReached) {
  EXPECT_TRUE(at(0.0, 2.0).limit({0.0, 2.0 + 0.81 * kCycle, 2.0, false}, kCycle).fired.acceleration);
  EXPECT_FALSE(at(0.0, 2.0).limit({0.0, 2.0 + 0.79 * kCycle, 2.0, false}, kCycle).fired.acceleration);
  EXPECT_TRUE(at(0.0, 2.0).limit({0.0, 2.0 - 1.21 * kCycle, 2.0, false}, kCycle).fired.acceleration);
  EXPECT_FALSE(at(0.0, 2.0).limit({0.0, 2.0 - 1.19 * kCycle, 2.0, false}, kCycle).fired.acceleration);
}

TEST(CommandLimiter, TheJerksLimitIsFlaggedOnlyWhereItIsReached) {
  const double step = 3.0 * kCycle * kCycle;
  EXPECT_TRUE(at(0.0, 2.0).limit({0.0, 2.0 + 1.01 * step, 2.0, false}, kCycle).fired.jerk);
  EXPECT_FALSE(at(0.0, 2.0).limit({0.0, 2.0 + 0.99 * step, 2.0, false}, kCycle).fired.jerk);
  EXPECT_TRUE(at(0.0, 2.0).limit({0.0, 2.0 - 1.01 * step, 2.0, false}, kCycle).fired.jerk);
  EXPECT_FALSE(at(0.0, 2.0).limit({0.0, 2.0 - 0.99 * step, 2.0, false}, kCycle).fired.jerk);
}

TEST(CommandLimiter, LandsOnItsSpeedAsTheJerkAllows) {
  for (const double sign : {1.0, -1.0}) {
    CommandLimiter limiter = at(0.0, 2.0);
    const double speed = limiter.limit({0.0, 2.0 + sign, 2.0, false}, kCycle).speed;
    const double landing = std::sqrt(2.0 * 3.0 * 0.004) - 3.0 * kCycle;
    const CommandLimiter::Result result = limiter.limit({0.0, speed + sign * 0.004, 2.0, false}, kCycle);
    EXPECT_NEAR(result.speed - speed, sign * landing * kCycle, 1e-12);
    EXPECT_TRUE(result.fired.jerk);
  }
}

// -------- parameters

struct Range {
  const char* key;
  double low, high;
  double CommandLimiterParameters::*field;
};
constexpr Range kRanges[] = {
    {"max_articulation", 0.05, 1.2, &CommandLimiterParameters::max_articulation},
    {"max_articulation_rate", 0.01, 2.0, &CommandLimiterParameters::max_articulation_rate},
    {"max_lateral_acceleration", 0.1, 5.0, &CommandLimiterParameters::max_lateral_acceleration},
    {"max_speed", 0.1, 15.0, &CommandLimiterParameters::max_speed},
    {"max_acceleration", 0.05, 5.0, &CommandLimiterParameters::max_acceleration},
    {"max_deceleration", 0.05, 5.0, &CommandLimiterParameters::max_deceleration},
    {"max_jerk", 0.1, 50.0, &CommandLimiterParameters::max_jerk},
    {"stop_deceleration", 0.05, 10.0, &CommandLimiterParameters::stop_deceleration},
};

YAML::Node middleOfAllRanges() {
  YAML::Node yaml;
  for (const Range& range : kRanges) yaml[range.key] = 0.5 * (range.low + range.high);
  return yaml;
}

CommandLimiterParameters loaded(const std::string& key, double value) {
  YAML::Node yaml = middleOfAllRanges();
  yaml[key] = value;
  return loadCommandLimiter(config::Node(yaml, "limiter"));
}

TEST(CommandLimiterParameters, AreTakenUpToTheEndsOfTheirRanges) {
  for (const Range& range : kRanges) {
    EXPECT_EQ(loaded(range.key, range.low).*range.field, range.low) << range.key;
    EXPECT_EQ(loaded(range.key, range.high).*range.field, range.high) << range.key;
  }
}

TEST(CommandLimiterParameters, AreRefusedBeyondTheirRanges) {
  for (const Range& range : kRanges) {
    EXPECT_THROW(loaded(range.key, 0.99 * range.low), config::ConfigError) << range.key;
    EXPECT_THROW(loaded(range.key, 1.01 * range.high), config::ConfigError) << range.key;
  }
}

TEST(CommandLimiterParameters, AnUnknownKeyIsRefused) {
  EXPECT_THROW(loaded("typo", 1.0), config::ConfigError);
}

// Whatever is asked, measured and however long it took.
TEST(CommandLimiter, NoLimitIsEverExceeded) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto wild = [&](double scale) {
    const double u = uniform(engine);
    if (u > 0.97) return kNaN;
    if (u < -0.97) return std::numeric_limits<double>::infinity() * uniform(engine);
    return scale * uniform(engine);
  };
  CommandLimiter limiter = at(0.0, 0.0);
  double angle = 0.0;
  double speed = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double elapsed = i % 50 == 0 ? wild(1.0) : 0.05 * std::abs(uniform(engine));
    const double counted = std::isfinite(elapsed) ? std::clamp(elapsed, 0.0, 0.1) : 0.0;
    const double measured = wild(12.0);
    const CommandLimiter::Result result =
        limiter.limit({wild(1.5), wild(15.0), measured, uniform(engine) > 0.95}, elapsed);
    ASSERT_TRUE(std::isfinite(result.articulation) && std::isfinite(result.speed));
    ASSERT_LE(std::abs(result.articulation), kLimits.max_articulation);
    ASSERT_LE(std::abs(result.articulation - angle), kLimits.max_articulation_rate * counted + 1e-12);
    ASSERT_GE(result.speed, 0.0);
    ASSERT_LE(result.speed, kLimits.max_speed);
    ASSERT_LE(result.speed - speed, kLimits.max_acceleration * counted + 1e-12);
    // Lateral acceleration is within its limit, or on its way there as fast as rate and braking allow.
    const double fastest = std::max(std::isfinite(measured) ? std::abs(measured) : 0.0, result.speed);
    if (lateralAcceleration(fastest, result.articulation) > kLimits.max_lateral_acceleration + 1e-9) {
      ASSERT_TRUE(result.fired.not_finite || result.fired.lateral_acceleration || result.fired.rate ||
                  std::abs(result.articulation) <= std::abs(angle) + 1e-12)
          << i;
    }
    angle = result.articulation;
    speed = result.speed;
  }
}

}  // namespace
}  // namespace tunnel_pilot::supervision
