#include <gtest/gtest.h>

#include <random>

#include "arbiter_bench.h"

namespace tunnel_pilot::supervision {
namespace {

// A bench whose inputs come and go by chance, with numbers that may be none.
class Chaos {
 public:
  explicit Chaos(std::uint32_t seed) : engine_(seed) { bench_.drive(); }

  bool chance(double probability) { return uniform_(engine_) < probability; }

  const Decision& cycle() {
    bench_.give_motion = !chance(0.1);
    bench_.give_state = !chance(0.1);
    bench_.give_scan = !chance(0.3);
    bench_.give_proposal = !chance(0.3);
    bench_.tunnel_valid = !chance(0.1);
    bench_.wanted = number(0.9);
    bench_.speed = std::abs(number(12.0));
    bench_.motion.articulation = chance(0.02) ? number(0.7) : bench_.motion.articulation;
    return bench_.cycle();
  }

  ArbiterBench& bench() { return bench_; }

 private:
  double number(double scale) {
    if (chance(0.02)) return std::numeric_limits<double>::quiet_NaN();
    if (chance(0.01)) return std::numeric_limits<double>::infinity();
    return scale * (2.0 * uniform_(engine_) - 1.0);
  }

  ArbiterBench bench_;
  std::mt19937 engine_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

// A2: 10^4 interleavings of inputs, each with a stop request at some moment.
TEST(ArbiterRandom, AStopRequestAlwaysStopsInTheSameCycleAndForGood) {
  Chaos chaos(1);
  ArbiterBench& bench = chaos.bench();
  for (int i = 0; i < 10000; ++i) {
    *bench.arbiter = Arbiter(bench.parameters, bench.truck);
    bench.state = {};
    for (int k = 0; k < 3; ++k) bench.cycle();
    bench.state = {true, false, Reason::kNone};
    const int before = static_cast<int>(i % 7);
    for (int k = 0; k < before; ++k) chaos.cycle();
    bench.arbiter->requestStop(bench.now);
    for (int k = 0; k < 5; ++k) {
      const Decision& decision = chaos.cycle();
      ASSERT_TRUE(decision.command.stop) << i;
      ASSERT_EQ(decision.command.speed, 0.0) << i;
      ASSERT_EQ(decision.command.reason, Reason::kOperatorStop) << i;
    }
  }
}

TEST(ArbiterRandom, NoCommandEverExceedsItsLimits) {
  Chaos chaos(2);
  const CommandLimiterParameters& limits = chaos.bench().parameters.limiter;
  double last = chaos.cycle().command.articulation_angle;
  bool obeyed = true;
  for (int i = 0; i < 10000; ++i) {
    if (i % 500 == 0) {
      chaos.bench().arbiter->setTruckState({}, chaos.bench().now);
      chaos.bench().state.engaged = !chaos.bench().state.engaged;
      obeyed = false;  // in standby the command follows the truck
    }
    const Decision& decision = chaos.cycle();
    const double angle = decision.command.articulation_angle;
    ASSERT_TRUE(std::isfinite(angle));
    ASSERT_LE(std::abs(angle), limits.max_articulation + 1e-12);
    ASSERT_GE(decision.command.speed, 0.0);
    ASSERT_LE(decision.command.speed, limits.max_speed);
    if (obeyed && decision.command.mode != Mode::kStandby) {
      ASSERT_LE(std::abs(angle - last), limits.max_articulation_rate * 0.02 + 1e-9) << i;
    }
    obeyed = decision.command.mode != Mode::kStandby;
    last = angle;
  }
}

TEST(ArbiterRandom, ACommandWithoutAStopAlwaysHasFreshInputsBehindIt) {
  Chaos chaos(3);
  ArbiterBench& bench = chaos.bench();
  int driven = 0;
  for (int episode = 0; episode < 500; ++episode) {
    *bench.arbiter = Arbiter(bench.parameters, bench.truck);
    bench.state = {};
    for (int k = 0; k < 3; ++k) bench.cycle();
    bench.state = {true, false, Reason::kNone};
    Stamp last_motion = bench.now;
    Stamp last_scan = bench.now;
    for (int i = 0; i < 40; ++i) {
      const Decision& decision = chaos.cycle();
      if (bench.give_motion) last_motion = bench.now;
      if (bench.give_scan) last_scan = bench.now;
      if (decision.command.stop) continue;
      ++driven;
      ASSERT_LE(toSeconds(bench.now - last_motion), bench.parameters.motion_stop_age + 1e-9);
      ASSERT_LE(toSeconds(bench.now - last_scan), bench.parameters.scan_stop_age + 1e-9);
    }
  }
  EXPECT_GT(driven, 500);
}

TEST(ArbiterRandom, OnceStoppedItNeverResumesByItself) {
  Chaos chaos(4);
  ArbiterBench& bench = chaos.bench();
  for (int episode = 0; episode < 200; ++episode) {
    *bench.arbiter = Arbiter(bench.parameters, bench.truck);
    bench.state = {};
    for (int k = 0; k < 3; ++k) bench.cycle();
    bench.state = {true, false, Reason::kNone};
    bool stopped = false;
    for (int i = 0; i < 100; ++i) {
      const Command& command = chaos.cycle().command;
      stopped = (command.stop && command.mode != Mode::kStandby) || stopped;
      if (!stopped) continue;
      ASSERT_TRUE(bench.arbiter->decide(bench.now).command.stop);
    }
  }
}

}  // namespace
}  // namespace tunnel_pilot::supervision
