// Numbers of the arbiter that change while it runs.
#include "tunnel_pilot/supervision/arbiter_tuning.h"

#include <gtest/gtest.h>

#include <random>
#include <sstream>

#include "arbiter_bench.h"

namespace tunnel_pilot::supervision {
namespace {

void tune(ArbiterBench& bench, const std::string& name, double value) {
  config::Tuning tuning = tuningOf(*bench.arbiter);
  ASSERT_FALSE(tuning.change({{name, value}}, false));
  bench.arbiter->tune(tuning.values());
}

TEST(ArbiterTuning, RangesAndUnitsAreTheLoaders) {
  const config::Node file = config::loadFile(ArbiterBench::config("arbiter.yaml"));
  loadArbiter(file);
  for (const ArbiterTunable& tunable : arbiterTunables()) {
    std::ostringstream range;
    range << "[" << tunable.number.min << ", " << tunable.number.max << "]";
    bool found = false;
    for (const config::ParameterRecord& record : file.records()) {
      if (record.key != tunable.number.name) continue;
      found = true;
      EXPECT_EQ(record.range, range.str()) << record.key;
      EXPECT_EQ(record.unit, tunable.number.unit) << record.key;
    }
    EXPECT_TRUE(found) << tunable.number.name;
  }
}

TEST(ArbiterTuning, StartsWithTheFilesValues) {
  const ArbiterBench bench;
  EXPECT_EQ(bench.parameters.governor.max_speed, tuningOf(*bench.arbiter).values().front());
}

TEST(ArbiterTuning, EveryValueArrivesAtItsKey) {
  const ArbiterBench bench;
  std::vector<double> values;
  for (const ArbiterTunable& tunable : arbiterTunables()) values.push_back(tunable.number.max);
  bench.arbiter->tune(values);
  EXPECT_EQ(values, tuningOf(*bench.arbiter).values());
}

TEST(ArbiterTuning, LowerMaxSpeedSlowsTheTruckDown) {
  ArbiterBench bench;
  bench.drive();
  tune(bench, "governor.max_speed", 1.0);
  EXPECT_DOUBLE_EQ(1.0, bench.cycle().speed_limit);
  EXPECT_FALSE(bench.cycle().command.stop);
  EXPECT_NEAR(1.0, bench.cycles(200).command.speed, 1e-6);
}

TEST(ArbiterTuning, SlowingDownKeepsTheLimitersDeceleration) {
  ArbiterBench bench;
  bench.drive();
  tune(bench, "governor.max_speed", 0.1);
  double last = bench.cycle().command.speed;
  for (int i = 0; i < 200; ++i) {
    const double speed = bench.cycle().command.speed;
    ASSERT_GE(speed, last - bench.parameters.limiter.max_deceleration * 0.02 - 1e-9);
    last = speed;
  }
}

TEST(ArbiterTuning, LargerSightReserveLowersTheSpeedLimit) {
  ArbiterBench bench;
  bench.drive();
  const double before = bench.cycle().speed_limit;
  tune(bench, "governor.sight_reserve", 15.0);
  EXPECT_LT(bench.cycle().speed_limit, before - 0.5);
}

TEST(ArbiterTuning, LargerMarginStopsATruckThatHasLessRoom) {
  ArbiterBench bench;
  bench.drive();
  ASSERT_FALSE(bench.cycle().command.stop);
  tune(bench, "envelope.margin", 2.0);
  EXPECT_EQ(Reason::kClearance, bench.cycles(20).command.reason);
}

TEST(ArbiterTuning, LoosensInStandbyAlone) {
  ArbiterBench bench;
  EXPECT_FALSE(bench.arbiter->mayLoosen(bench.now)) << "nothing heard of the truck";
  const auto after = [&bench](bool engaged, bool stopping) {
    bench.state = {engaged, stopping, Reason::kNone};
    bench.cycle();
    return bench.arbiter->mayLoosen(bench.now);
  };
  EXPECT_TRUE(after(false, false));
  EXPECT_FALSE(after(true, false));
  EXPECT_FALSE(after(false, true));
}

TEST(ArbiterTuning, NothingLoosensWhileTheTruckIsSilent) {
  ArbiterBench bench;
  bench.cycle();
  ASSERT_TRUE(bench.arbiter->mayLoosen(bench.now));
  EXPECT_FALSE(bench.arbiter->mayLoosen(bench.now + std::chrono::milliseconds(300)));
}

TEST(ArbiterTuning, NothingLoosensOnATruckWithoutStates) {
  ArbiterBench bench(false);
  bench.cycles(5);
  EXPECT_FALSE(bench.arbiter->mayLoosen(bench.now));
}

// P2: and each decision in between keeps what was asked for.
TEST(ArbiterTuning, TenThousandRandomRequestsLeaveAValidConfiguration) {
  ArbiterBench bench;
  bench.drive();
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> beyond(-0.1, 1.1);
  config::Tuning tuning = tuningOf(*bench.arbiter);
  for (int i = 0; i < 10000; ++i) {
    config::Tuning::Request request;
    for (const ArbiterTunable& tunable : arbiterTunables()) {
      const config::TunableNumber& n = tunable.number;
      if (engine() % 8 == 0) request.emplace_back(n.name, n.min + beyond(engine) * (n.max - n.min));
    }
    if (!tuning.change(request, engine() % 2 == 0)) bench.arbiter->tune(tuning.values());
    ASSERT_EQ(tuning.values(), tuningOf(*bench.arbiter).values());
    for (std::size_t k = 0; k < arbiterTunables().size(); ++k) {
      const config::TunableNumber& n = arbiterTunables()[k].number;
      ASSERT_TRUE(tuning.values()[k] >= n.min && tuning.values()[k] <= n.max) << n.name;
    }
    if (i % 10 == 0) {
      const Decision& decision = bench.cycle();
      ASSERT_LE(decision.speed_limit, tuning.values().front());
      ASSERT_TRUE(std::isfinite(decision.command.speed));
    }
  }
}

}  // namespace
}  // namespace tunnel_pilot::supervision
