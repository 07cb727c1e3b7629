#include "tunnel_pilot/supervision/arbiter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "arbiter_bench.h"

namespace tunnel_pilot::supervision {
namespace {

using std::chrono::milliseconds;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Cycles until a stop, in seconds; 10 s when there is none.
double secondsToStop(ArbiterBench& bench) {
  for (int i = 1; i <= 500; ++i) {
    if (bench.cycle().command.stop) return 0.02 * i;
  }
  return 10.0;
}

// ---- the normal way

TEST(Arbiter, DrivesAsAskedWhenAllIsWell) {
  ArbiterBench bench;
  bench.drive();
  const Decision& decision = bench.cycle();
  EXPECT_FALSE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kNone);
  EXPECT_EQ(decision.command.mode, Mode::kAutonomous);
  EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
  EXPECT_DOUBLE_EQ(decision.command.speed, 3.0);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kDriver);
}

TEST(Arbiter, TheCommandCarriesTheMeasurementsStamp) {
  ArbiterBench bench;
  bench.drive();
  const Stamp stamp = bench.cycle().command.stamp;
  EXPECT_EQ(stamp, bench.now - bench.latency);
}

TEST(Arbiter, TheSequenceGrowsWithEveryDecision) {
  ArbiterBench bench;
  std::uint32_t last = bench.cycle().command.sequence;
  for (int i = 0; i < 50; ++i) {
    const std::uint32_t next = bench.cycle().command.sequence;
    EXPECT_GT(next, last);
    last = next;
  }
}

TEST(Arbiter, WithoutAnyInputItStopsAndSaysStartUp) {
  ArbiterBench bench;
  for (int i = 0; i < 10; ++i) {
    const Decision& decision = bench.arbiter->decide(bench.now + milliseconds(20 * i));
    EXPECT_TRUE(decision.command.stop);
    EXPECT_EQ(decision.command.reason, Reason::kStartUp);
    EXPECT_EQ(decision.command.speed, 0.0);
    EXPECT_EQ(decision.command.source, Source::kHold);
  }
}

TEST(Arbiter, HealthyButNotEngagedItStandsByWithoutAStop) {
  ArbiterBench bench;
  const Decision& decision = bench.cycles(10);
  EXPECT_FALSE(decision.command.stop);
  EXPECT_EQ(decision.command.mode, Mode::kStandby);
  EXPECT_EQ(decision.command.reason, Reason::kNotEngaged);
}

TEST(Arbiter, NotEngagedTheCommandStaysWithTheArticulationSoThatEngagingIsNoJump) {
  ArbiterBench bench;
  bench.motion.articulation = 0.2;
  bench.wanted = -0.3;
  EXPECT_NEAR(bench.cycles(50).command.articulation_angle, 0.2,
              bench.parameters.limiter.max_articulation_rate * 0.02 + 1e-9);
}

TEST(Arbiter, ATruckThatStopsWithoutAKnownReasonIsStoppedAllTheSame) {
  for (const auto reason : {Reason::kNone, static_cast<Reason>(250)}) {
    ArbiterBench bench;
    bench.drive();
    bench.state.stopping = true;
    bench.state.reason = reason;
    EXPECT_TRUE(bench.cycle().command.stop);
    EXPECT_EQ(bench.cycle().command.reason, Reason::kTruckFault);
  }
}

TEST(Arbiter, ATruckWithoutStatesIsTakenAsEngaged) {
  ArbiterBench bench(false);
  bench.give_state = false;
  EXPECT_EQ(bench.cycles(10).command.mode, Mode::kAutonomous);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kNone);
}

// ---- choice

TEST(Arbiter, TheHealthySourceOfHighestPrioritySteers) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(0.01), bench.now);
  EXPECT_EQ(bench.cycle().command.source, Source::kLidarDriver);
  bench.arbiter->setProposal(Source::kTeleoperation, bench.proposal(0.02), bench.now);
  EXPECT_EQ(bench.cycle().command.source, Source::kTeleoperation);
  EXPECT_EQ(bench.cycle().command.mode, Mode::kTeleoperation);
}

TEST(Arbiter, TheDriverSelectedSteersAndTheOneLeftOutNeitherSteersNorSlowsDown) {
  ArbiterBench bench;
  bench.drive();
  const auto unsure = [&] {
    drivers::Proposal proposal = bench.proposal(0.01, 1.0);
    proposal.confidence = 0.0;
    return proposal;
  };
  ASSERT_TRUE(bench.arbiter->selectDriver(Source::kPreviewDriver));
  for (int i = 0; i < 100; ++i) {
    bench.arbiter->setProposal(Source::kLidarDriver, unsure(), bench.now);
    const Decision& decision = bench.cycle();
    EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
    EXPECT_EQ(decision.command.reason, Reason::kNone);
    EXPECT_DOUBLE_EQ(decision.command.speed, 3.0);
  }
  ASSERT_TRUE(bench.arbiter->selectDriver(Source::kLidarDriver));
  bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(0.01), bench.now);
  EXPECT_EQ(bench.cycle().command.source, Source::kLidarDriver);
}

TEST(Arbiter, OnlyADriverOfTheTableCanBeSelected) {
  ArbiterBench bench;
  bench.drive();
  EXPECT_FALSE(bench.arbiter->selectDriver(Source::kTeleoperation));
  EXPECT_FALSE(bench.arbiter->selectDriver(Source::kWireDriver));
  ArbiterParameters without = bench.parameters;
  without.sources.erase(
      std::remove_if(without.sources.begin(), without.sources.end(),
                     [](const SourceRule& rule) { return rule.source == Source::kPreviewDriver; }),
      without.sources.end());
  Arbiter alone(without, bench.truck);
  EXPECT_FALSE(alone.selectDriver(Source::kPreviewDriver)) << "nobody would be left";
  EXPECT_EQ(alone.parameters().sources.size(), without.sources.size());
}

TEST(Arbiter, ASelectionWhileDrivingIsNoJump) {
  ArbiterBench bench;
  bench.drive();
  bench.wanted = 0.0;
  double last = 0.0;
  for (int i = 0; i < 200; ++i) {
    if (i == 100) bench.arbiter->selectDriver(Source::kPreviewDriver);
    bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(0.1), bench.now);
    const double angle = bench.cycle().command.articulation_angle;
    EXPECT_LE(std::abs(angle - last), bench.parameters.limiter.max_articulation_rate * 0.02 + 1e-9);
    last = angle;
  }
}

TEST(Arbiter, TheLowestSpeedAskedForWinsWhoeverSteers) {
  ArbiterBench bench;
  bench.drive();
  Decision decision;
  for (int i = 0; i < 200; ++i) {
    bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(0.0, 1.2), bench.now);
    bench.motion.speed = bench.cycle().command.speed;
    decision = bench.arbiter->decide(bench.now);
  }
  EXPECT_NEAR(decision.command.speed, 1.2, 1e-6);
  EXPECT_EQ(decision.speed_source, Source::kLidarDriver);
}

TEST(Arbiter, AnUnhealthySourceIsDroppedForTheNext) {
  for (const double bad : {kNaN, 2.0}) {
    ArbiterBench bench;
    bench.drive();
    bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(bad), bench.now);
    const Decision& decision = bench.cycle();
    EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
    EXPECT_FALSE(decision.command.stop);
  }
}

TEST(Arbiter, AProposalOfAnOldMeasurementIsNotFollowed) {
  ArbiterBench bench;
  bench.drive();
  drivers::Proposal old = bench.proposal(0.1);
  old.stamp = bench.now - milliseconds(160);
  bench.arbiter->setProposal(Source::kLidarDriver, old, bench.now);
  EXPECT_EQ(bench.arbiter->decide(bench.now).command.source, Source::kPreviewDriver);
}

TEST(Arbiter, AProposalFromTheFutureIsNotFollowed) {
  ArbiterBench bench;
  bench.drive();
  drivers::Proposal early = bench.proposal(0.1);
  early.stamp = bench.now + milliseconds(60);
  bench.arbiter->setProposal(Source::kLidarDriver, early, bench.now);
  EXPECT_EQ(bench.arbiter->decide(bench.now).command.source, Source::kPreviewDriver);
}

// ---- a driver that is unsure, drivers that disagree (RELIABILITY N3)

drivers::Proposal lidarProposal(const ArbiterBench& bench, double confidence,
                                double articulation = 0.01) {
  drivers::Proposal proposal = bench.proposal(articulation);
  proposal.confidence = confidence;
  return proposal;
}

const Decision& cyclesWith(ArbiterBench& bench, int count, double confidence,
                           double articulation = 0.01) {
  const Decision* decision = nullptr;
  for (int i = 0; i < count; ++i) {
    bench.arbiter->setProposal(Source::kLidarDriver, lidarProposal(bench, confidence, articulation),
                               bench.now);
    decision = &bench.cycle();
  }
  return *decision;
}

double lidarsLeast(const ArbiterBench& bench) {
  for (const SourceRule& rule : bench.parameters.sources) {
    if (rule.source == Source::kLidarDriver) return rule.min_confidence;
  }
  return 0.0;
}

TEST(Arbiter, AnUnsureSourceIsDroppedForTheNextWhichDrivesSlowly) {
  ArbiterBench bench;
  bench.drive();
  const double least = lidarsLeast(bench);
  ASSERT_GT(least, 0.0);
  EXPECT_EQ(cyclesWith(bench, 1, least).command.source, Source::kLidarDriver);
  EXPECT_FALSE(bench.arbiter->decide(bench.now).degraded);
  for (const double unsure : {least - 1e-6, 0.0, kNaN}) {
    const Decision& decision = cyclesWith(bench, 1, unsure);
    EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
    EXPECT_TRUE(decision.degraded);
    EXPECT_FALSE(decision.command.stop);
    EXPECT_EQ(decision.command.reason, Reason::kLowConfidence);
  }
}

TEST(Arbiter, ASourceThatMustBeSureAndProposesNothingIsUnsure) {
  ArbiterBench bench;
  bench.drive();
  drivers::Proposal none = bench.proposal();
  none.valid = false;
  bench.arbiter->setProposal(Source::kTeleoperation, none, bench.now);
  EXPECT_FALSE(bench.cycle().degraded) << "an operator who does not steer";
  none.stamp = bench.now - bench.latency;
  bench.arbiter->setProposal(Source::kLidarDriver, none, bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.degraded);
  EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
  EXPECT_EQ(decision.command.reason, Reason::kLowConfidence);
}

TEST(Arbiter, ASourceThatIsSureAgainSteersAtOnceAndDrivesFastAfterASecond) {
  ArbiterBench bench;
  bench.drive();
  cyclesWith(bench, 5, 0.0);
  const Decision& at_once = cyclesWith(bench, 1, 1.0);
  EXPECT_EQ(at_once.command.source, Source::kLidarDriver);
  EXPECT_TRUE(at_once.degraded);
  EXPECT_TRUE(cyclesWith(bench, 45, 1.0).degraded);
  EXPECT_FALSE(cyclesWith(bench, 10, 1.0).degraded);
}

TEST(Arbiter, AnUnsureSourceAloneStops) {
  ArbiterBench bench;
  bench.give_proposal = false;
  bench.parameters.sources.resize(1);
  ASSERT_EQ(bench.parameters.sources[0].source, Source::kLidarDriver);
  bench.arbiter = std::make_unique<Arbiter>(bench.parameters, bench.truck);
  cyclesWith(bench, 5, 1.0);
  bench.state = {true, false, Reason::kNone};
  EXPECT_FALSE(cyclesWith(bench, 10, 1.0).command.stop);
  const Decision& decision = cyclesWith(bench, 1, 0.0);
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kLowConfidence);
}

TEST(Arbiter, AnUnsureSourceBelowTheOneThatSteersSlowsNothing) {
  ArbiterBench bench;
  bench.drive();
  for (int i = 0; i < 10; ++i) {
    bench.arbiter->setProposal(Source::kTeleoperation, bench.proposal(), bench.now);
    EXPECT_FALSE(cyclesWith(bench, 1, 0.0).degraded);
  }
}

TEST(Arbiter, AnUnsureSourceGivesNoSpeed) {
  ArbiterBench bench;
  bench.drive();
  drivers::Proposal slow = lidarProposal(bench, 0.0);
  slow.speed = 0.2;
  bench.arbiter->setProposal(Source::kLidarDriver, slow, bench.now);
  EXPECT_NE(bench.cycle().speed_source, Source::kLidarDriver);
}

TEST(Arbiter, DriversThatDisagreeForAFifthOfASecondDriveSlowly) {
  ArbiterBench bench;
  bench.drive();
  const double beyond = bench.parameters.disagreement_angle + 0.001;
  EXPECT_FALSE(cyclesWith(bench, 10, 1.0, beyond).degraded);
  const Decision& decision = cyclesWith(bench, 2, 1.0, beyond);
  EXPECT_TRUE(decision.degraded);
  EXPECT_EQ(decision.command.reason, Reason::kDriversDisagree);
  EXPECT_FALSE(decision.command.stop);
}

TEST(Arbiter, DriversThatDisagreeNowAndThenDriveOn) {
  ArbiterBench bench;
  bench.drive();
  const double beyond = bench.parameters.disagreement_angle + 0.001;
  for (int i = 0; i < 5; ++i) {
    EXPECT_FALSE(cyclesWith(bench, 9, 1.0, beyond).degraded);
    EXPECT_FALSE(cyclesWith(bench, 1, 1.0, beyond - 0.002).degraded);
  }
}

TEST(Arbiter, ADriverThatIsSelectedAnewHasNotDisagreedYet) {
  ArbiterBench bench;
  bench.drive();
  const double beyond = bench.parameters.disagreement_angle + 0.001;
  EXPECT_FALSE(cyclesWith(bench, 10, 1.0, beyond).degraded);
  ASSERT_TRUE(bench.arbiter->selectDriver(Source::kLidarDriver));
  EXPECT_FALSE(cyclesWith(bench, 9, 1.0, beyond).degraded);
}

// Each pair of sources, each way: the hand-over stays within the rate limit.
TEST(Arbiter, AHandOverIsNoJump) {
  const std::vector<Source> sources = {Source::kPreviewDriver, Source::kLidarDriver,
                                       Source::kTeleoperation};
  for (const Source from : sources) {
    for (const Source to : sources) {
      ArbiterBench bench;
      bench.give_proposal = false;
      bench.arbiter->setProposal(from, bench.proposal(), bench.now);
      bench.state = {true, false, Reason::kNone};
      double last = 0.0;
      for (int i = 0; i < 100; ++i) {
        bench.arbiter->setProposal(i < 50 ? from : to, bench.proposal(i < 50 ? 0.05 : -0.3), bench.now);
        const double angle = bench.cycle().command.articulation_angle;
        EXPECT_LE(std::abs(angle - last), bench.parameters.limiter.max_articulation_rate * 0.02 + 1e-9);
        bench.motion.articulation = angle;
        last = angle;
      }
    }
  }
}

// ---- ages (RELIABILITY A1, L1)

TEST(Arbiter, ASilentSourceStopsWithinItsAgeAndTheStopIsSteeredByDeadReckoning) {
  ArbiterBench bench;
  bench.drive();
  bench.give_proposal = false;
  EXPECT_NEAR(secondsToStop(bench), 0.12, 0.021);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kSourceStale);
  EXPECT_EQ(bench.cycle().command.source, Source::kDeadReckoning);
}

TEST(Arbiter, ScansMissingSlowDownAfterATenthAndStopAfterThreeTenthsOfASecond) {
  for (const int gap : {99, 101, 299, 301}) {  // [ms] since the last scan was received
    ArbiterBench bench;
    bench.latency = Stamp(0);  // so that receptions alone are judged
    bench.drive();
    const Stamp last_scan = bench.now;
    bench.give_scan = bench.give_proposal = false;
    while (bench.now + milliseconds(20) < last_scan + milliseconds(gap)) bench.cycle();
    const Stamp then = last_scan + milliseconds(gap);
    bench.motion.stamp = then;
    bench.arbiter->setMotion(bench.motion, then);
    bench.arbiter->setTruckState(bench.state, then);
    const Decision& decision = bench.arbiter->decide(then);
    EXPECT_EQ(decision.degraded || decision.command.stop, gap > 100) << gap;
    EXPECT_EQ(decision.command.stop, gap > 300) << gap;
    EXPECT_EQ(decision.command.reason == Reason::kScanStale, gap > 100) << gap;
  }
}

// The limits are those of missing scans; only the words tell that some come and why they are refused.
TEST(Arbiter, RejectedScansAreToldFromMissingOnes) {
  for (const bool frozen : {false, true}) {
    const Reason expected = frozen ? Reason::kScanFrozen : Reason::kScanRejected;
    for (const int gap : {99, 101, 299, 301}) {  // [ms] since the last scan was accepted
      ArbiterBench bench;
      bench.latency = Stamp(0);
      bench.drive();
      const Stamp last_scan = bench.now;
      bench.give_scan = bench.give_proposal = false;
      while (bench.now + milliseconds(20) < last_scan + milliseconds(gap)) {
        bench.arbiter->setRejection({frozen}, bench.now + milliseconds(20));
        bench.cycle();
      }
      const Stamp then = last_scan + milliseconds(gap);
      bench.motion.stamp = then;
      bench.arbiter->setMotion(bench.motion, then);
      bench.arbiter->setTruckState(bench.state, then);
      const Decision& decision = bench.arbiter->decide(then);
      EXPECT_EQ(decision.degraded || decision.command.stop, gap > 100) << gap;
      EXPECT_EQ(decision.command.stop, gap > 300) << gap;
      EXPECT_EQ(decision.command.reason == expected, gap > 100) << gap;
    }
  }
}

TEST(Arbiter, AfterTheLastRejectedScanThereIsNone) {
  ArbiterBench bench;
  bench.drive();
  bench.give_scan = bench.give_proposal = false;
  bench.arbiter->setRejection({false}, bench.now);
  EXPECT_EQ(bench.cycles(20).command.reason, Reason::kScanStale);
}

TEST(Arbiter, RejectedScansBetweenAcceptedOnesAreNoFault) {
  ArbiterBench bench;
  bench.drive();
  for (int i = 0; i < 20; ++i) {
    bench.arbiter->setRejection({true}, bench.now);
    EXPECT_EQ(bench.cycle().command.reason, Reason::kNone);
  }
}

TEST(Arbiter, ScansRejectedBeforeAnyWasAcceptedAreStartingUp) {
  ArbiterBench bench;
  bench.give_scan = bench.give_proposal = false;
  for (int i = 0; i < 20; ++i) {
    bench.arbiter->setRejection({false}, bench.now);
    bench.cycle();
  }
  EXPECT_EQ(bench.cycle().command.reason, Reason::kStartUp);
}

// Between a scan's points and the proposal that comes of them lie other decisions.
TEST(Arbiter, AScanAfterAGapIsGivenTimeToBecomeAProposal) {
  ArbiterBench bench;
  bench.drive();
  bench.give_scan = bench.give_proposal = false;
  EXPECT_TRUE(bench.cycles(10).degraded);
  bench.give_scan = true;
  const Decision& decision = bench.cycle();
  EXPECT_FALSE(decision.command.stop) << toString(decision.command.reason);
  bench.give_proposal = true;
  EXPECT_FALSE(bench.cycles(60).degraded);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kNone);
}

TEST(Arbiter, AScanAfterAGapThatBecomesNoProposalStops) {
  ArbiterBench bench;
  bench.drive();
  bench.give_scan = bench.give_proposal = false;
  bench.cycles(10);
  bench.give_scan = true;
  // The last proposal's measurement is 0.24 s old by now.
  EXPECT_LE(secondsToStop(bench), 0.08);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kSourceStale);
}

TEST(Arbiter, AMeasurementOlderThanThreeTenthsOfASecondStopsByItsStamp) {
  ArbiterBench bench;
  bench.drive();
  bench.give_scan = bench.give_proposal = false;
  // The last scan's stamp is 40 ms older than its reception.
  EXPECT_NEAR(secondsToStop(bench), 0.28, 0.021);
}

TEST(Arbiter, DegradedDrivingIsSlowAndRecoversAfterASecondOfHealth) {
  ArbiterBench bench;
  bench.drive();
  bench.give_scan = bench.give_proposal = false;
  bench.cycles(7);
  bench.give_scan = bench.give_proposal = true;
  EXPECT_TRUE(bench.cycle().degraded);
  for (int i = 0; i < 40; ++i) bench.motion.speed = bench.cycle().command.speed;
  EXPECT_LT(bench.cycle().command.speed, 3.0);
  EXPECT_TRUE(bench.cycle().degraded);
  EXPECT_FALSE(bench.cycles(12).degraded);
}

TEST(Arbiter, SilentMotionStops) {
  ArbiterBench bench;
  bench.drive();
  bench.give_motion = false;
  EXPECT_NEAR(secondsToStop(bench), 0.12, 0.021);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kMotionStale);
}

TEST(Arbiter, ASilentTruckStops) {
  ArbiterBench bench;
  bench.drive();
  bench.give_state = false;
  EXPECT_NEAR(secondsToStop(bench), 0.26, 0.021);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kFeedbackStale);
}

// ---- the tunnel (E1), numbers that are none (E2)

TEST(Arbiter, ALostTunnelIsBridgedByDeadReckoningForHalfASecondAndThenStops) {
  ArbiterBench bench;
  bench.drive();
  bench.tunnel_valid = bench.proposal_valid = false;
  const Decision& at_once = bench.cycle();
  EXPECT_FALSE(at_once.command.stop);
  EXPECT_EQ(at_once.command.source, Source::kDeadReckoning);
  EXPECT_TRUE(bench.cycles(10).degraded);
  EXPECT_NEAR(secondsToStop(bench), 0.5 - 0.2, 0.041);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kTunnelInvalid);
}

TEST(Arbiter, MotionThatIsNoNumberStopsInTheSameCycle) {
  ArbiterBench bench;
  bench.drive();
  drivers::Motion bad = bench.motion;
  bad.yaw_rate = kNaN;
  bench.arbiter->setMotion(bad, bench.now);
  EXPECT_TRUE(bench.arbiter->decide(bench.now).command.stop);
}

TEST(Arbiter, MotionFromTheFutureIsRefusedAndHidesNoneThatComesAfterIt) {
  ArbiterBench bench;
  bench.drive();
  drivers::Motion bad = bench.motion;
  bad.stamp = bench.now + std::chrono::hours(27);
  bad.pose.x = 1e6;
  EXPECT_FALSE(bench.arbiter->setMotion(bad, bench.now));
  EXPECT_FALSE(bench.cycles(50).command.stop);
  EXPECT_FALSE(bench.cycle().degraded);
}

TEST(Arbiter, MotionFromTheFutureIsNoSignOfLife) {
  ArbiterBench bench;
  bench.drive();
  bench.give_motion = false;
  drivers::Motion bad = bench.motion;
  for (int i = 1; i < 10; ++i) {
    bad.stamp = bench.now + i * std::chrono::hours(27);
    bench.arbiter->setMotion(bad, bench.now);
    bench.cycle();
  }
  EXPECT_EQ(bench.cycle().command.reason, Reason::kMotionStale);
}

TEST(Arbiter, AProposalThatIsNoNumberFromTheOnlySourceStopsInTheSameCycle) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->setProposal(Source::kPreviewDriver, bench.proposal(kNaN), bench.now);
  const Decision& decision = bench.arbiter->decide(bench.now);
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kProposalInvalid);
  EXPECT_TRUE(std::isfinite(decision.command.articulation_angle));
}

// ---- how a stop steers

TEST(Arbiter, AStopIsWhatLimitsTheSpeed) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->requestStop(bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_EQ(decision.limited_by, SpeedLimit::kStop);
  EXPECT_EQ(decision.speed_source, Source::kNone);
  EXPECT_EQ(decision.command.speed, 0.0);
}

TEST(Arbiter, AStopSteersOnTheBestHealthySource) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->requestStop(bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
  EXPECT_EQ(decision.command.speed, 0.0);
}

TEST(Arbiter, WithoutOdometryAStopHoldsTheArticulation) {
  ArbiterBench bench;
  bench.drive();
  bench.wanted = 0.1;
  for (int i = 0; i < 40; ++i) bench.motion.articulation = bench.cycle().command.articulation_angle;
  bench.give_motion = bench.give_proposal = bench.give_scan = false;
  const Decision& decision = bench.cycles(20);
  EXPECT_EQ(decision.command.source, Source::kHold);
  EXPECT_NEAR(decision.command.articulation_angle, 0.1, 0.02);
}

TEST(Arbiter, DeadReckoningFollowsTheLastCenterlineIntoItsBend) {
  ArbiterBench bench;
  const double k = 1.0 / 15.0;
  bench.line = geometry::buildPath({{22.0, 0.0, 0.0}, {8.0, 0.0, k}, {60.0, k, k}}, {}, 0.25);
  bench.drive();
  bench.give_scan = bench.give_proposal = false;
  bench.motion.speed = 2.0;
  EXPECT_GT(bench.cycles(150).command.articulation_angle, 0.05);
}

// ---- latching

TEST(Arbiter, AStopIsNotEndedByRecovery) {
  ArbiterBench bench;
  bench.drive();
  bench.give_proposal = false;
  secondsToStop(bench);
  bench.give_proposal = true;
  for (int i = 0; i < 500; ++i) {
    const Decision& decision = bench.cycle();
    EXPECT_TRUE(decision.command.stop);
    EXPECT_EQ(decision.command.reason, Reason::kSourceStale);
  }
}

TEST(Arbiter, AStoppingTruckIsToldToStopWhateverItsInputs) {
  ArbiterBench bench;
  bench.drive();
  bench.state = {false, true, Reason::kOperatorOverride};
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kOperatorOverride);
}

TEST(Arbiter, AnOperatorsResetOfTheTruckEndsTheStopAfterItsTime) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->requestStop(bench.now);
  bench.cycle();
  bench.state = {false, true, Reason::kOperatorStop};
  bench.motion.speed = 0.0;
  bench.cycles(100);
  bench.state = {false, false, Reason::kNotEngaged};
  EXPECT_FALSE(bench.cycles(3).command.stop);
  EXPECT_EQ(bench.cycle().command.mode, Mode::kStandby);
}

TEST(Arbiter, AStopRequestedWhileStandingByHoldsForASecondSoThatEngagingIsRefused) {
  ArbiterBench bench;
  bench.cycles(10);
  bench.arbiter->requestStop(bench.now);
  EXPECT_TRUE(bench.cycles(45).command.stop);
  EXPECT_FALSE(bench.cycles(10).command.stop);
}

TEST(Arbiter, ATruckWithoutStatesIsResetByHandOnlyAtRestAndHealthy) {
  ArbiterBench bench(false);
  bench.drive();
  bench.arbiter->requestStop(bench.now);
  EXPECT_TRUE(bench.cycle().command.stop);
  EXPECT_FALSE(bench.arbiter->reset(bench.now)) << "moving";
  bench.motion.speed = 0.0;
  bench.give_motion = false;
  bench.cycles(20);
  EXPECT_FALSE(bench.arbiter->reset(bench.now)) << "no motion feedback";
  bench.give_motion = true;
  EXPECT_TRUE(bench.cycles(5).command.stop);
  EXPECT_TRUE(bench.arbiter->reset(bench.now));
  EXPECT_FALSE(bench.cycle().command.stop);
}

TEST(Arbiter, AnArbiterThatStartsBehindADrivingTruckStopsIt) {
  ArbiterBench bench;
  bench.state = {true, false, Reason::kNone};
  EXPECT_TRUE(bench.cycle().command.stop);
  EXPECT_TRUE(bench.cycles(50).command.stop);
}

// ---- the corridor

TEST(Arbiter, ASuddenObstacleWithinTheStoppingDistanceStops) {
  ArbiterBench bench;
  bench.drive();
  bench.obstacle = 5.0;
  EXPECT_NEAR(secondsToStop(bench), 0.04, 1e-9);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kObstacle);
}

TEST(Arbiter, OneScanOfAnObstacleIsNotBelieved) {
  ArbiterBench bench;
  bench.drive();
  bench.obstacle = 5.0;
  const Decision& decision = bench.cycle();
  EXPECT_NE(decision.limited_by, SpeedLimit::kObstacle);
  EXPECT_EQ(decision.command.reason, Reason::kNone);
  bench.obstacle.reset();
  EXPECT_FALSE(bench.cycles(20).command.stop);
}

TEST(Arbiter, TooLittleRoomWithinTheStoppingDistanceBrakesAtOnceAndStopsWhenItStays) {
  ArbiterBench bench;
  bench.drive();
  bench.narrow = 5.0;
  bench.cycles(2);
  const Decision first = bench.cycle();
  EXPECT_FALSE(first.command.stop);
  EXPECT_LT(first.command.speed, 3.0);
  const Decision& last = bench.cycles(bench.parameters.wall_scans);
  EXPECT_TRUE(last.command.stop);
  EXPECT_EQ(last.command.reason, Reason::kClearance);
}

TEST(Arbiter, TooLittleRoomInAFewScansDoesNotStop) {
  ArbiterBench bench;
  bench.drive();
  bench.narrow = 5.0;
  bench.cycles(bench.parameters.wall_scans - 1);
  bench.narrow.reset();
  EXPECT_FALSE(bench.cycles(20).command.stop);
}

TEST(Arbiter, AnObstacleFarAheadOnlySlowsDown) {
  ArbiterBench bench;
  bench.drive();
  bench.obstacle = 9.5;
  const Decision& decision = bench.cycles(3);
  EXPECT_FALSE(decision.command.stop);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kObstacle);
  EXPECT_LT(decision.speed_limit, 3.0);
}

TEST(Arbiter, StandingBeforeAnObstacleSaysSo) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.drive();
  bench.obstacle = 3.4;  // within the governor's reserve, beyond the stop's
  const Decision& decision = bench.cycles(5);
  EXPECT_FALSE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kObstacle);
}

TEST(Arbiter, BeforeAnObstacleThatComesAndGoesTheTruckStandsUntilTheWayIsFreeForAWhile) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.drive();
  bench.obstacle = 3.4;
  bench.cycles(50);
  for (int i = 0; i < 5; ++i) {
    bench.obstacle.reset();
    for (int k = 0; k < 45; ++k) {
      const Decision& free = bench.cycle();
      EXPECT_EQ(free.command.speed, 0.0);
      EXPECT_EQ(free.command.reason, Reason::kObstacle);
    }
    bench.obstacle = 3.4;
    bench.cycles(2);
  }
  bench.obstacle.reset();
  EXPECT_GT(bench.cycles(60).command.speed, 0.0);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kNone);
}

TEST(Arbiter, TellsCorridorClearanceAndDistances) {
  ArbiterBench bench;
  bench.drive();
  const Decision& decision = bench.cycle();
  EXPECT_NEAR(decision.clearance_left, 0.975, 0.02);
  EXPECT_NEAR(decision.clearance_right, 0.975, 0.02);
  EXPECT_GT(decision.free_distance, 20.0);
  EXPECT_NEAR(decision.stopping_distance, 3.0 * 0.55 + 4.5, 1e-9);
  ASSERT_FALSE(decision.corridor_left.empty());
  ASSERT_FALSE(decision.corridor_right.empty());
  EXPECT_GT(decision.corridor_left.back().y(), decision.corridor_right.back().y() + 2.0);
}

TEST(Arbiter, PointsOfOneScanWithWallsOfAnotherAreNotCompared) {
  ArbiterBench bench;
  bench.drive();
  for (int i = 0; i < 20; ++i) {
    bench.give_scan = false;
    bench.scene.walls.stamp = bench.now - milliseconds(60);
    bench.scene.tunnel.state.stamp = bench.now - milliseconds(40);
    bench.arbiter->setPoints(bench.scene.points, bench.now - milliseconds(40), bench.now);
    bench.arbiter->setWalls(bench.scene.walls, bench.now);
    bench.arbiter->setTunnel(bench.scene.tunnel, bench.now);
    bench.cycle();
  }
  EXPECT_EQ(bench.cycle().command.reason, Reason::kScanStale);
}

// ---- steering, limits, clock

TEST(Arbiter, SteeringThatDoesNotFollowStops) {
  ArbiterBench bench;
  bench.drive();
  bench.wanted = 0.3;  // the measured articulation stays at 0
  const double seconds = secondsToStop(bench);
  EXPECT_GT(seconds, 0.9);
  EXPECT_LT(seconds, 1.4);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kTrackingError);
}

TEST(Arbiter, AngleLimitsHitAgainAndAgainDegrade) {
  ArbiterBench bench;
  bench.drive();
  bench.wanted = 0.9;  // beyond the highest command
  EXPECT_FALSE(bench.cycles(3).degraded);
  EXPECT_EQ(bench.cycles(3).command.reason, Reason::kLimitsHit);
  EXPECT_TRUE(bench.cycle().degraded);
}

TEST(Arbiter, AClockThatJumpsBackStopsAndForgets) {
  ArbiterBench bench;
  bench.drive();
  const Decision& decision = bench.arbiter->decide(bench.now - milliseconds(1));
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kClockJump);
  EXPECT_TRUE(std::isnan(decision.clearance_left));
}

TEST(Arbiter, AClockThatJumpsForwardStops) {
  ArbiterBench bench;
  bench.drive();
  EXPECT_EQ(bench.arbiter->decide(bench.now + milliseconds(600)).command.reason, Reason::kClockJump);
}

TEST(Arbiter, ADecisionTwiceAtOneTimeMovesNothing) {
  ArbiterBench bench;
  bench.drive();
  bench.wanted = 0.2;
  const double once = bench.cycle().command.articulation_angle;
  EXPECT_EQ(bench.arbiter->decide(bench.now).command.articulation_angle, once);
}

TEST(Arbiter, EveryReasonHasItsOwnGravity) {
  std::set<int> seen;
  for (int code = 1; code <= static_cast<int>(Reason::kProcessSilent); ++code) {
    EXPECT_TRUE(seen.insert(gravity(static_cast<Reason>(code))).second) << code;
  }
  EXPECT_EQ(gravity(Reason::kNone), 0);
}

TEST(Arbiter, TheGravestReasonIsTold) {
  ArbiterBench bench;
  bench.cycles(10);
  bench.give_proposal = bench.give_motion = false;
  EXPECT_EQ(bench.cycles(10).command.reason, Reason::kMotionStale);
}

}  // namespace
}  // namespace tunnel_pilot::supervision
