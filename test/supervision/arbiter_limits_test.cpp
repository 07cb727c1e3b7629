#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "arbiter_bench.h"

// Limits are held to the nanosecond: an age of exactly its limit is still healthy. Each is tried alone,
// with all others far away.
namespace tunnel_pilot::supervision {
namespace {

constexpr double kLimit = 0.25;  // [s] a number that has an exact binary form
constexpr Stamp kExactly = std::chrono::milliseconds(250);
constexpr Stamp kMoment = Stamp(1);

using Setting = std::function<void(ArbiterParameters&)>;

void startAnew(ArbiterBench& bench) {
  bench.arbiter = std::make_unique<Arbiter>(bench.parameters, bench.truck);
}

// Driving, with inputs that are all of the last cycle's time.
ArbiterBench driving(const Setting& set) {
  ArbiterBench bench;
  ArbiterParameters& p = bench.parameters;
  p.max_stamp_age = p.scan_degraded_age = p.scan_stop_age = p.motion_stop_age = 100.0;
  p.truck_state_stop_age = p.tunnel_grace = p.clock_jump = 100.0;
  for (SourceRule& rule : p.sources) rule.max_age = 100.0;
  set(p);
  startAnew(bench);
  bench.latency = Stamp::zero();
  bench.drive();
  return bench;
}

void expectLimit(const Setting& set, Reason beyond) {
  for (const bool late : {false, true}) {
    ArbiterBench bench = driving(set);
    const Decision& decision = bench.arbiter->decide(bench.now + kExactly + (late ? kMoment : Stamp(0)));
    EXPECT_EQ(decision.command.reason, late ? beyond : Reason::kNone);
  }
}

TEST(ArbiterLimits, AScanStopsBeyondItsAge) {
  expectLimit([](auto& p) { p.scan_stop_age = kLimit; }, Reason::kScanStale);
}

TEST(ArbiterLimits, AScanSlowsBeyondItsAge) {
  expectLimit([](auto& p) { p.scan_degraded_age = kLimit; }, Reason::kScanStale);
}

TEST(ArbiterLimits, ATunnelStopsBeyondItsGrace) {
  expectLimit([](auto& p) { p.tunnel_grace = kLimit; }, Reason::kTunnelInvalid);
}

TEST(ArbiterLimits, MotionStopsBeyondItsAge) {
  expectLimit([](auto& p) { p.motion_stop_age = kLimit; }, Reason::kMotionStale);
}

TEST(ArbiterLimits, AMeasurementStopsBeyondItsAge) {
  expectLimit(
      [](auto& p) {
        p.max_stamp_age = kLimit;
        for (SourceRule& rule : p.sources) rule.max_age = kLimit + 0.01;
      },
      Reason::kMotionStale);
}

TEST(ArbiterLimits, TheTruckStopsBeyondItsAge) {
  expectLimit([](auto& p) { p.truck_state_stop_age = kLimit; }, Reason::kFeedbackStale);
}

TEST(ArbiterLimits, AProposalStopsBeyondItsAge) {
  expectLimit(
      [](auto& p) {
        for (SourceRule& rule : p.sources) rule.max_age = kLimit;
      },
      Reason::kSourceStale);
}

TEST(ArbiterLimits, AProposalIsInvalidFromBeyondTheFutureAllowed) {
  for (const bool beyond : {false, true}) {
    ArbiterBench bench = driving([](auto& p) { p.max_future = kLimit; });
    drivers::Proposal proposal = bench.proposal();
    proposal.stamp = bench.now + kExactly + (beyond ? kMoment : Stamp(0));
    bench.arbiter->setProposal(Source::kPreviewDriver, proposal, bench.now);
    const Reason reason = bench.arbiter->decide(bench.now).command.reason;
    EXPECT_EQ(reason, beyond ? Reason::kProposalInvalid : Reason::kNone);
  }
}

TEST(ArbiterLimits, AProposalOfARightAngleIsInvalid) {
  for (const bool right : {false, true}) {
    ArbiterBench bench = driving([](auto&) {});
    bench.wanted = right ? M_PI_2 : std::nextafter(M_PI_2, 0.0);
    EXPECT_EQ(bench.cycle().command.reason == Reason::kProposalInvalid, right);
  }
}

TEST(ArbiterLimits, DriversDisagreeFromTheTimeOn) {
  for (const bool before : {false, true}) {
    ArbiterBench bench = driving([](auto& p) { p.disagreement_time = kLimit; });
    const double beyond = bench.parameters.disagreement_angle + 0.001;
    bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(beyond), bench.now);
    bench.arbiter->decide(bench.now);
    const Stamp then = bench.now + kExactly - (before ? kMoment : Stamp(0));
    EXPECT_EQ(bench.arbiter->decide(then).degraded, !before);
  }
}

TEST(ArbiterLimits, DriversDisagreeBeyondTheAngle) {
  for (const bool beyond : {false, true}) {
    ArbiterBench bench = driving([](auto& p) { p.disagreement_time = 0.0; });
    const double angle = bench.parameters.disagreement_angle;
    bench.arbiter->setProposal(Source::kLidarDriver,
                               bench.proposal(beyond ? std::nextafter(angle, 1.0) : angle), bench.now);
    EXPECT_EQ(bench.arbiter->decide(bench.now).degraded, beyond);
  }
}

TEST(ArbiterLimits, DriversThatTurnAlikeDoNotDisagree) {
  ArbiterBench bench = driving([](auto& p) { p.disagreement_time = 0.0; });
  bench.wanted = 0.3;
  bench.inputs();
  bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(0.3), bench.now);
  EXPECT_NE(bench.arbiter->decide(bench.now).command.reason, Reason::kDriversDisagree);
}

TEST(ArbiterLimits, AStopEndsBeyondTheRecoveryTime) {
  for (const bool beyond : {false, true}) {
    ArbiterBench bench = driving([](auto& p) { p.recovery_time = kLimit; });
    bench.arbiter->requestStop(bench.now);
    bench.arbiter->setTruckState({}, bench.now + kExactly + (beyond ? kMoment : Stamp(0)));
    EXPECT_EQ(bench.cycle().command.stop, !beyond);
  }
}

TEST(ArbiterLimits, ATruckOfAtMostAStandingSpeedCanBeReset) {
  for (const bool moves : {false, true}) {
    ArbiterBench bench(false);
    bench.motion.speed = moves ? 0.0501 : 0.05;
    bench.cycles(10);
    bench.arbiter->requestStop(bench.now);
    EXPECT_EQ(bench.arbiter->reset(bench.now), !moves);
  }
}

TEST(ArbiterLimits, RejectionsCountForTwiceAScansAge) {
  for (const auto after : {Stamp::zero(), kMoment}) {
    ArbiterBench bench = driving([](auto& p) {
      p.scan_degraded_age = 0.125;
      p.scan_stop_age = 0.125;
    });
    bench.arbiter->setRejection({false}, bench.now);
    const Reason reason = bench.arbiter->decide(bench.now + kExactly + after).command.reason;
    EXPECT_EQ(reason, after == Stamp::zero() ? Reason::kScanRejected : Reason::kScanStale);
  }
}

TEST(ArbiterLimits, AStopIsSteeredAlongACenterlineUpToItsAge) {
  for (const bool beyond : {false, true}) {
    ArbiterBench bench = driving([](auto& p) {
      p.dead_reckoning_age = kLimit;
      for (SourceRule& rule : p.sources) rule.max_age = 0.1;
    });
    const Stamp then = bench.now + kExactly + (beyond ? kMoment : Stamp(0));
    EXPECT_EQ(bench.arbiter->decide(then).command.source,
              beyond ? Source::kHold : Source::kDeadReckoning);
  }
}

TEST(ArbiterLimits, AfterTheRecoveryTimeTheTruckIsSlowNoLonger) {
  for (const bool before : {false, true}) {
    ArbiterBench bench = driving([](auto& p) { p.recovery_time = kLimit; });
    drivers::Proposal proposal = bench.proposal();
    proposal.confidence = 0.0;
    bench.arbiter->setProposal(Source::kLidarDriver, proposal, bench.now);
    ASSERT_TRUE(bench.arbiter->decide(bench.now).degraded);
    proposal.confidence = 1.0;
    bench.arbiter->setProposal(Source::kLidarDriver, proposal, bench.now);
    const Stamp then = bench.now + kExactly - (before ? kMoment : Stamp(0));
    EXPECT_EQ(bench.arbiter->decide(then).degraded, before);
  }
}

TEST(ArbiterLimits, LimitsHitCountWhenNoFurtherApartThanTheRecoveryTime) {
  for (const bool further : {false, true}) {
    ArbiterBench bench = driving([](auto& p) {
      p.recovery_time = kLimit;
      p.limit_hits = 2;
    });
    bench.wanted = 0.9;
    bench.cycle();
    const Stamp then = bench.now + kExactly + (further ? kMoment : Stamp(0));
    bench.arbiter->decide(then);
    EXPECT_EQ(bench.arbiter->decide(then).degraded, !further);
  }
}

// ---- what is told

TEST(ArbiterLimits, ALostTunnelSlowsDownInItsOwnName) {
  ArbiterBench bench = driving([](auto& p) { p.scan_degraded_age = kLimit; });
  bench.tunnel_valid = false;
  EXPECT_EQ(bench.cycles(14).command.reason, Reason::kTunnelInvalid);
}

TEST(ArbiterLimits, ADegradedSpeedIsNobodysWish) {
  ArbiterBench bench = driving([](auto& p) { p.scan_degraded_age = kLimit; });
  bench.give_scan = false;
  const Decision& decision = bench.cycles(14);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kDegraded);
  EXPECT_EQ(decision.speed_source, Source::kNone);
}

TEST(ArbiterLimits, ACommandTellsHowHardTheTruckMayBrakeOrSpeedUp) {
  ArbiterBench bench;
  bench.drive();
  const CommandLimiterParameters& limits = bench.parameters.limiter;
  EXPECT_EQ(bench.cycle().command.acceleration, limits.max_acceleration);
  bench.arbiter->requestStop(bench.now);
  EXPECT_EQ(bench.cycle().command.acceleration, limits.stop_deceleration);
}

TEST(ArbiterLimits, ALimitThatTakesEffectIsTold) {
  ArbiterBench bench;
  bench.drive();
  EXPECT_FALSE(bench.cycle().limits.angle);
  bench.wanted = 0.9;
  EXPECT_TRUE(bench.cycle().limits.angle);
}

TEST(ArbiterLimits, AnArbiterThatFindsATruckUnderWaySaysThatItStartsUp) {
  ArbiterBench bench;
  bench.state = {true, false, Reason::kNone};
  bench.cycles(5);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kStartUp);
}

// Five cycles of 3 m of sight, then 25 m again.
void loseSight(ArbiterBench& bench) {
  bench.give_scan = false;
  for (int i = 0; i < 5; ++i) {
    bench.scene = sceneAt(bench.line, {20.0, 0.0, 0.0}, 5.0, bench.now, 3.0);
    bench.arbiter->setPoints(bench.scene.points, bench.now, bench.now);
    bench.arbiter->setWalls(bench.scene.walls, bench.now);
    bench.arbiter->setTunnel(bench.scene.tunnel, bench.now);
    bench.cycle();
  }
  EXPECT_EQ(bench.arbiter->decide(bench.now).limited_by, SpeedLimit::kSight);
  bench.give_scan = true;
}

TEST(ArbiterLimits, ATruckThatStoodAtTheEndOfSightDrivesOnWhenItHasSeenFurtherForAWhile) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.drive();
  loseSight(bench);
  const Decision& decision = bench.cycles(30);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kSight);
  EXPECT_LT(decision.command.speed, 0.05);
  bench.cycles(static_cast<int>(bench.parameters.recovery_time / 0.02));
  EXPECT_GT(bench.cycle().command.speed, 0.05);
}

TEST(ArbiterLimits, ATruckThatMovesAtTheEndOfSightDrivesOnAtOnce) {
  for (const double speed : {0.05, 1.0}) {
    ArbiterBench bench;
    bench.motion.speed = speed;
    bench.drive();
    loseSight(bench);
    EXPECT_NE(bench.cycles(3).limited_by, SpeedLimit::kSight) << speed;
  }
}

TEST(ArbiterLimits, ADriverThatHasFallenSilentDisagreesWithNobodyWhoeverSteers) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->setProposal(Source::kLidarDriver,
                             bench.proposal(bench.parameters.disagreement_angle + 0.1), bench.now);
  for (int i = 0; i < 30; ++i) {
    bench.arbiter->setProposal(Source::kTeleoperation, bench.proposal(), bench.now);
    EXPECT_FALSE(bench.cycle().degraded) << i;
  }
}

// ---- what counts once

TEST(ArbiterLimits, AScanOfAnObstacleCountsOnceHoweverManyDecisionsFollow) {
  ArbiterBench bench;
  bench.drive();
  bench.obstacle = 4.0;
  bench.cycle();
  bench.give_scan = false;
  EXPECT_FALSE(bench.cycles(3).command.stop);
}

TEST(ArbiterLimits, TheFirstDecisionMovesNothing) {
  ArbiterBench bench(false);
  bench.motion.articulation = 0.1;
  bench.wanted = 0.3;
  EXPECT_DOUBLE_EQ(bench.cycle().command.articulation_angle, 0.1);
}

TEST(ArbiterLimits, AHingeTurnedWhileOthersSteeredIsWhereSteeringIsExpectedToBegin) {
  ArbiterBench bench;
  bench.motion.articulation = bench.wanted = 0.3;
  bench.drive();
  EXPECT_NE(bench.cycles(40).command.reason, Reason::kTrackingError);
}

TEST(ArbiterLimits, ALostTunnelExcusesNoDriverWhoseProposalIsInvalid) {
  ArbiterBench bench;
  bench.drive();
  bench.tunnel_valid = false;
  bench.wanted = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(bench.cycle().command.reason, Reason::kProposalInvalid);
}

TEST(ArbiterLimits, ABendLimitsTheSpeed) {
  ArbiterBench bench;
  bench.line = geometry::buildPath({{24.0, 0.0, 0.0}, {30.0, 1.0 / 15.0, 1.0 / 15.0}}, {}, 0.5);
  bench.speed = 7.0;
  bench.drive();
  const SpeedLimit by = bench.cycles(5).limited_by;
  EXPECT_TRUE(by == SpeedLimit::kLateralAcceleration || by == SpeedLimit::kArticulationRate)
      << toString(by);
}

TEST(ArbiterLimits, WithoutACorridorNoClearanceIsKnown) {
  ArbiterBench bench;
  bench.give_scan = false;
  const Decision& decision = bench.cycles(3);
  EXPECT_TRUE(std::isnan(decision.clearance_left));
  EXPECT_TRUE(std::isnan(decision.clearance_right));
}

}  // namespace
}  // namespace tunnel_pilot::supervision
