// Counts allocations in a program of its own.
#include <gtest/gtest.h>

#include <cmath>

#include "../allocations.h"
#include "arbiter_bench.h"

namespace tunnel_pilot::supervision {
namespace {

// Engaged and under way since a while, so that the buffers have grown.
struct ArbiterAllocation : testing::Test {
  void SetUp() override {
    SKIP_WHERE_ALLOCATIONS_ARE_NOT_COUNTED();
    ASSERT_EQ(allocationsOfOne(), 1);
    bench.drive();
    decision = &bench.cycles(100);
    EXPECT_EQ(reason(), Reason::kNone);
  }

  // Allocations of the decisions of so many cycles of steering to and fro.
  long ofDecisions(int cycles) {
    long count = 0;
    for (int i = 0; i < cycles; ++i) {
      bench.wanted = 0.02 * std::sin(0.05 * ++steps);
      bench.motion.articulation = decision->command.articulation_angle;
      bench.inputs();
      count += allocationsOf([&] { decision = &bench.arbiter->decide(bench.now); });
    }
    return count;
  }

  Reason reason() const { return decision->command.reason; }

  ArbiterBench bench;
  const Decision* decision = nullptr;
  int steps = 0;
};

TEST_F(ArbiterAllocation, NoneWhileItDrives) {
  EXPECT_EQ(ofDecisions(1000), 0);
  EXPECT_EQ(reason(), Reason::kNone);
}

TEST_F(ArbiterAllocation, NoneWhenTheTunnelIsLostAndTheStopIsSteeredByDeadReckoning) {
  bench.tunnel_valid = bench.proposal_valid = false;
  EXPECT_EQ(ofDecisions(100), 0);
  EXPECT_EQ(reason(), Reason::kTunnelInvalid);
}

TEST_F(ArbiterAllocation, NoneWhenAnObstacleStops) {
  bench.obstacle = 8.0;
  EXPECT_EQ(ofDecisions(100), 0);
  EXPECT_EQ(reason(), Reason::kObstacle);
}

TEST_F(ArbiterAllocation, NoneWhenTheWallsComeNearer) {
  bench.narrow = 5.0;
  EXPECT_EQ(ofDecisions(100), 0);
  EXPECT_EQ(reason(), Reason::kClearance);
}

TEST_F(ArbiterAllocation, NoneWhenTheDriverFallsSilent) {
  bench.give_proposal = false;
  EXPECT_EQ(ofDecisions(100), 0);
  EXPECT_EQ(reason(), Reason::kSourceStale);
}

}  // namespace
}  // namespace tunnel_pilot::supervision
