#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "arbiter_bench.h"
#include "tunnel_pilot/vehicle/articulation.h"

// What an ordinary drive never shows: inputs that come in an odd order or not at all, tables without
// walls or with sources that do not steer.
namespace tunnel_pilot::supervision {
namespace {

using std::chrono::milliseconds;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

SourceRule& ruleOf(ArbiterBench& bench, Source source) {
  for (SourceRule& rule : bench.parameters.sources) {
    if (rule.source == source) return rule;
  }
  throw std::logic_error("no such rule");
}

void startAnew(ArbiterBench& bench) {
  bench.arbiter = std::make_unique<Arbiter>(bench.parameters, bench.truck);
}

// ---- proposals

TEST(ArbiterEdge, AProposalWithoutAPossibleSpeedIsInvalid) {
  for (const double speed : {kNaN, -0.1}) {
    ArbiterBench bench;
    bench.drive();
    bench.speed = speed;
    EXPECT_EQ(bench.cycle().command.reason, Reason::kProposalInvalid) << speed;
  }
}

TEST(ArbiterEdge, ASourceThatDoesNotSteerOnlyLimitsTheSpeed) {
  ArbiterBench bench;
  ruleOf(bench, Source::kTeleoperation).steers = false;
  startAnew(bench);
  bench.drive();
  bench.arbiter->setProposal(Source::kTeleoperation, bench.proposal(0.3, 2.5), bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_EQ(decision.command.source, Source::kPreviewDriver);
  EXPECT_EQ(decision.speed_source, Source::kTeleoperation);
}

TEST(ArbiterEdge, ASourceThatDoesNotSteerIsNoSourceOfSteering) {
  ArbiterBench bench;
  ruleOf(bench, Source::kTeleoperation).steers = false;
  startAnew(bench);
  bench.drive();
  bench.give_proposal = false;
  Decision decision;
  for (int i = 0; i < 20; ++i) {
    bench.arbiter->setProposal(Source::kTeleoperation, bench.proposal(), bench.now);
    decision = bench.cycle();
  }
  EXPECT_EQ(decision.command.reason, Reason::kSourceStale);
  EXPECT_EQ(decision.command.source, Source::kDeadReckoning);
}

TEST(ArbiterEdge, ASourceThatGivesNoSpeedLimitsNone) {
  ArbiterBench bench;
  ruleOf(bench, Source::kLidarDriver).gives_speed = false;
  startAnew(bench);
  bench.drive();
  bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(0.0, 1.0), bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_EQ(decision.command.source, Source::kLidarDriver);
  EXPECT_EQ(decision.speed_source, Source::kPreviewDriver);
}

TEST(ArbiterEdge, ADriverWhoseRowDoesNotSteerCannotBeSelected) {
  ArbiterBench bench;
  ruleOf(bench, Source::kLidarDriver).steers = false;
  startAnew(bench);
  EXPECT_FALSE(bench.arbiter->selectDriver(Source::kLidarDriver));
}

// A late scan excuses all that wait for it, a lost tunnel all that need it.
TEST(ArbiterEdge, TwoDriversThatWaitForALateScanAreExcusedBoth) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->setProposal(Source::kLidarDriver, bench.proposal(), bench.now);
  bench.cycle();
  bench.give_scan = bench.give_proposal = false;
  EXPECT_FALSE(bench.cycles(8).command.stop);
  EXPECT_EQ(bench.cycles(10).command.reason, Reason::kScanStale);
}

TEST(ArbiterEdge, TwoDriversThatLackTheTunnelAreExcusedBoth) {
  ArbiterBench bench;
  bench.drive();
  bench.tunnel_valid = bench.proposal_valid = false;
  drivers::Proposal unable = bench.proposal();
  unable.valid = false;
  for (int i = 0; i < 4; ++i) {
    unable.stamp = bench.now;
    bench.arbiter->setProposal(Source::kLidarDriver, unable, bench.now);
    EXPECT_FALSE(bench.cycle().command.stop) << i;
  }
}

TEST(ArbiterEdge, ADriverThatIsUnableInAValidTunnelIsNotExcused) {
  ArbiterBench bench;
  bench.drive();
  bench.proposal_valid = false;
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kNoSource);
}

// ---- an order of inputs that is not the usual one

TEST(ArbiterEdge, MotionThatNeverWasANumberIsNotWaitedFor) {
  ArbiterBench bench;
  bench.motion.yaw_rate = kNaN;
  EXPECT_EQ(bench.cycle().command.reason, Reason::kMotionStale);
}

TEST(ArbiterEdge, MotionIsTakenAlsoWhenItTellsNothingNewUnlessItIsNone) {
  ArbiterBench bench;
  bench.cycles(5);
  drivers::Motion motion = bench.motion;
  motion.stamp += milliseconds(10);
  EXPECT_TRUE(bench.arbiter->setMotion(motion, bench.now));
  EXPECT_TRUE(bench.arbiter->setMotion(motion, bench.now)) << "once more";
  motion.speed = kNaN;
  EXPECT_FALSE(bench.arbiter->setMotion(motion, bench.now));
}

TEST(ArbiterEdge, MotionFromBeyondAMillionIsRefusedAndStopsInTheSameCycle) {
  for (const bool pose : {true, false}) {
    ArbiterBench bench;
    bench.drive();
    drivers::Motion bad = bench.motion;
    (pose ? bad.pose.x : bad.speed) = 1e300;
    bad.stamp += milliseconds(10);
    EXPECT_FALSE(bench.arbiter->setMotion(bad, bench.now)) << pose;
    EXPECT_EQ(bench.arbiter->decide(bench.now).command.reason, Reason::kMotionStale) << pose;
  }
}

TEST(ArbiterEdge, ASpeedBeyondAllSenseDoesNotBlindTheCorridorForWhatComesAfterIt) {
  ArbiterBench bench;
  bench.cycles(10);
  drivers::Motion bad = bench.motion;
  bad.speed = 1e300;
  bad.stamp += milliseconds(10);
  bench.arbiter->setMotion(bad, bench.now);
  bench.cycles(20);
  bench.obstacle = 4.0;
  EXPECT_EQ(bench.cycles(5).command.reason, Reason::kObstacle);
}

// ---- odometry that jumps

// What odometry tells of the truck from now on, as seen from where it was.
void jump(ArbiterBench& bench, const geometry::Pose& by) {
  bench.motion.pose = bench.motion.pose.compose(by);
}

// Each brings walls where the truck stands, if those of one frame are taken for the other's.
const std::vector<geometry::Pose> kJumps = {{1.6, 1.6, 0.0},  {1.6, -1.6, 0.0}, {-2.0, 1.5, 0.0},
                                            {0.0, 0.0, -1.1}, {0.0, 0.0, 1.1},  {0.0, 0.5, 3.1}};

// The scans are measured at the time of a motion, or between two.
TEST(ArbiterEdge, AStandingTruckEngagesAfterAFalsePoseWithoutDriving) {
  for (const milliseconds latency : {milliseconds(40), milliseconds(33)}) {
    for (const geometry::Pose& by : kJumps) {
      ArbiterBench bench;
      bench.latency = latency;
      bench.motion.speed = 0.0;
      bench.cycles(20);
      const geometry::Pose here = bench.motion.pose;
      jump(bench, by);
      bench.cycle();
      bench.motion.pose = here;
      EXPECT_EQ(bench.cycles(50).command.reason, Reason::kNotEngaged) << by.x << " " << by.y;
      bench.state = {true, false, Reason::kNone};
      EXPECT_EQ(bench.cycles(50).command.reason, Reason::kNone) << by.x << " " << by.y;
      EXPECT_EQ(bench.arbiter->odometryJumps(), 2u);
    }
  }
}

TEST(ArbiterEdge, AFalsePoseTooNearToBeAJumpKeepsNoTruckFromEngaging) {
  for (const geometry::Pose& by : {geometry::Pose{0.0, 0.24, 0.0}, geometry::Pose{0.0, 0.0, 0.095}}) {
    ArbiterBench bench;
    bench.motion.speed = 0.0;
    bench.cycles(20);
    const geometry::Pose here = bench.motion.pose;
    jump(bench, by);
    bench.cycles(10);
    bench.motion.pose = here;
    EXPECT_EQ(bench.cycles(50).command.reason, Reason::kNotEngaged) << by.y << " " << by.heading;
    EXPECT_EQ(bench.arbiter->odometryJumps(), 0u);
  }
}

TEST(ArbiterEdge, ATruckWhoseOdometryWasSetAnewEngagesWithoutDriving) {
  for (const geometry::Pose& by : kJumps) {
    ArbiterBench bench;
    bench.cycles(300);  // 18 m
    bench.motion.speed = 0.0;
    bench.cycles(20);
    jump(bench, by);
    EXPECT_EQ(bench.cycles(50).command.reason, Reason::kNotEngaged) << by.x << " " << by.y;
    EXPECT_EQ(bench.arbiter->odometryJumps(), 1u);
  }
}

// Drives past a place where the left wall stands nearer, until that is beside the rear body.
void passANarrowPlace(ArbiterBench& bench) {
  bench.cycles(60);
  bench.narrower = 0.5;
  bench.cycles(20);
  bench.narrower = 0.0;
  bench.cycles(60);
}

constexpr double kRoom = 0.975;  // [m] beside a truck in the middle of the drift

TEST(ArbiterEdge, AfterAJumpOnlyWhatIsSeenNowIsKnownAsAtAStart) {
  ArbiterBench bench;
  passANarrowPlace(bench);
  ASSERT_NEAR(bench.cycle().clearance_left, kRoom - 0.5, 0.02) << "the wall that was passed";
  jump(bench, {0.0, 0.0, 1.0});
  EXPECT_NEAR(bench.cycles(3).clearance_left, kRoom, 0.02);
}

TEST(ArbiterEdge, AfterAClockJumpOnlyWhatIsSeenNowIsKnown) {
  ArbiterBench bench;
  passANarrowPlace(bench);
  bench.arbiter->clockJumped();
  EXPECT_NEAR(bench.cycles(3).clearance_left, kRoom, 0.02);
}

TEST(ArbiterEdge, AfterAJumpTheWallsAreRememberedAgainFromThereOn) {
  ArbiterBench bench;
  bench.cycles(20);
  jump(bench, {50.0, 20.0, 0.0});
  passANarrowPlace(bench);
  EXPECT_NEAR(bench.cycle().clearance_left, kRoom - 0.5, 0.02);
}

TEST(ArbiterEdge, WithoutAJumpTheWallsPassedStayKnown) {
  ArbiterBench bench;
  bench.motion.speed = bench.speed = 7.0;
  bench.cycles(20);
  bench.narrower = 0.5;
  bench.cycles(10);
  bench.narrower = 0.0;
  bench.cycles(20);
  bench.give_scan = false;
  bench.cycles(12);
  bench.give_scan = true;
  bench.give_motion = false;
  bench.cycles(4);
  bench.motion.pose.x += 4 * 7.0 * 0.02;
  bench.give_motion = true;
  EXPECT_NEAR(bench.cycle().clearance_left, kRoom - 0.5, 0.02);
  EXPECT_EQ(bench.arbiter->odometryJumps(), 0u);
}

TEST(ArbiterEdge, AfterAJumpNoStopIsSteeredAlongACenterlineOfTheOldFrame) {
  ArbiterBench bench;
  bench.drive();
  bench.tunnel_valid = bench.proposal_valid = false;
  ASSERT_EQ(bench.cycles(10).command.source, Source::kDeadReckoning);
  jump(bench, {0.0, 0.0, 1.0});
  EXPECT_EQ(bench.cycle().command.source, Source::kHold);
}

TEST(ArbiterEdge, AfterAJumpNoWayIsExpectedAlongACenterlineOfTheOldFrame) {
  const auto endOfCorridor = [](bool jumps) {
    ArbiterBench bench;
    bench.line = geometry::buildPath({{20.0, 0.0, 0.0}, {40.0, 0.05, 0.05}}, {}, 0.5);
    bench.drive();
    bench.tunnel_valid = false;
    if (jumps) jump(bench, {0.0, 0.0, 1.0});
    return bench.cycle().corridor_left.back().y();
  };
  EXPECT_GT(endOfCorridor(false), 2.0) << "along the bend";
  EXPECT_LT(endOfCorridor(true), 1.6) << "as the hinge stands";
}

TEST(ArbiterEdge, WithoutMotionNoStoppingDistanceIsKnown) {
  ArbiterBench bench;
  bench.give_motion = false;
  EXPECT_TRUE(std::isnan(bench.cycle().stopping_distance));
  bench.give_motion = true;
  EXPECT_GT(bench.cycle().stopping_distance, 0.0);
  bench.give_motion = false;
  bench.arbiter->clockJumped();
  EXPECT_TRUE(std::isnan(bench.cycle().stopping_distance));
}

TEST(ArbiterEdge, MotionThatWasMeasuredLongAgoIsStale) {
  ArbiterBench bench;
  bench.drive();
  bench.give_motion = false;
  const Stamp measured = bench.motion.stamp;
  Reason reason = Reason::kNone;
  for (int i = 0; i < 10 && reason == Reason::kNone; ++i) {
    bench.motion.stamp = measured + milliseconds(i);
    bench.arbiter->setMotion(bench.motion, bench.now);  // comes all the time, and is old
    reason = bench.cycle().command.reason;
  }
  EXPECT_EQ(reason, Reason::kMotionStale);
}

TEST(ArbiterEdge, WithoutMotionAnEngagedTruckIsHeldAndThenSteeredFromWhereItStands) {
  ArbiterBench bench;
  bench.cycles(1);
  startAnew(bench);
  bench.give_motion = false;
  bench.cycles(2);
  bench.state = {true, false, Reason::kNone};
  EXPECT_EQ(bench.cycle().command.articulation_angle, 0.0);
  bench.give_motion = true;
  bench.motion.articulation = bench.wanted = 0.2;
  bench.motion.speed = 0.0;
  EXPECT_NEAR(bench.cycle().command.articulation_angle, 0.2, 1e-12);
}

TEST(ArbiterEdge, AScanWithoutItsWallsIsWaitedFor) {
  ArbiterBench bench;
  bench.cycle();
  startAnew(bench);
  bench.give_scan = false;
  bench.arbiter->setPoints(bench.scene.points, bench.now, bench.now);
  bench.scene.tunnel.state.stamp = bench.now;
  bench.arbiter->setTunnel(bench.scene.tunnel, bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_EQ(decision.command.reason, Reason::kStartUp);
  EXPECT_TRUE(std::isnan(decision.clearance_left));
}

TEST(ArbiterEdge, AScanWithoutItsTunnelIsNotCompared) {
  ArbiterBench bench;
  bench.cycle();
  startAnew(bench);
  bench.give_scan = false;
  for (int i = 0; i < 2; ++i) {  // first without any tunnel, then with that of an older scan
    const Stamp scan = bench.now;
    bench.scene.walls.stamp = scan;
    bench.arbiter->setPoints(bench.scene.points, scan, bench.now);
    bench.arbiter->setWalls(bench.scene.walls, bench.now);
    EXPECT_TRUE(std::isnan(bench.cycle().clearance_left)) << i;
    bench.scene.tunnel.state.stamp = scan;
    bench.arbiter->setTunnel(bench.scene.tunnel, bench.now);
  }
}

TEST(ArbiterEdge, WithoutAnyTunnelTheWallsAreComparedAllTheSame) {
  ArbiterBench bench;
  bench.tunnel_valid = false;
  const Decision& decision = bench.cycles(5);
  EXPECT_EQ(decision.command.reason, Reason::kTunnelInvalid);
  EXPECT_NEAR(decision.clearance_left, 0.975, 0.02);
}

TEST(ArbiterEdge, AValidTunnelWithoutACenterlineIsNone) {
  ArbiterBench bench;
  bench.drive();
  bench.give_scan = false;
  Decision decision;
  for (int i = 0; i < 40; ++i) {
    bench.scene = sceneAt(bench.line, {20.0, 0.0, 0.0}, 5.0, bench.now, 25.0);
    bench.scene.tunnel.centerline = geometry::Path();
    bench.arbiter->setPoints(bench.scene.points, bench.now, bench.now);
    bench.arbiter->setWalls(bench.scene.walls, bench.now);
    bench.arbiter->setTunnel(bench.scene.tunnel, bench.now);
    decision = bench.cycle();
  }
  EXPECT_EQ(decision.command.reason, Reason::kTunnelInvalid);
}

TEST(ArbiterEdge, ACenterlineSeenBeforeTheFirstMotionSteersNoStop) {
  ArbiterBench bench;
  bench.give_motion = false;
  bench.cycle();
  bench.give_motion = true;
  bench.give_scan = bench.give_proposal = false;
  EXPECT_EQ(bench.cycles(8).command.source, Source::kHold);
}

TEST(ArbiterEdge, ACenterlineTooOldForDeadReckoningHolds) {
  ArbiterBench bench;
  bench.drive();
  bench.tunnel_valid = bench.proposal_valid = false;
  const int cycles = static_cast<int>(bench.parameters.dead_reckoning_age / 0.02);
  EXPECT_EQ(bench.cycles(cycles - 5).command.source, Source::kDeadReckoning);
  EXPECT_EQ(bench.cycles(10).command.source, Source::kHold);
}

TEST(ArbiterEdge, AfterAClockJumpMotionIsWaitedForAsAtTheStart) {
  ArbiterBench bench;
  bench.cycles(5);
  bench.arbiter->clockJumped();
  bench.give_motion = false;
  EXPECT_EQ(bench.cycle().command.reason, Reason::kStartUp);
}

TEST(ArbiterEdge, AfterAClockJumpNobodyIsSlowForWhatWasBefore) {
  ArbiterBench bench;
  bench.cycles(5);
  bench.give_scan = false;
  ASSERT_TRUE(bench.cycles(8).degraded);
  bench.arbiter->clockJumped();
  bench.give_scan = true;
  EXPECT_FALSE(bench.cycles(2).degraded);
}

TEST(ArbiterEdge, AfterAClockJumpScansThatShowAnObstacleAreCountedAnew) {
  ArbiterBench bench;
  bench.cycles(5);
  bench.obstacle = 3.0;
  const int too_few = bench.parameters.obstacle_scans - 1;
  ASSERT_NE(bench.cycles(too_few).command.reason, Reason::kObstacle);
  bench.arbiter->clockJumped();
  EXPECT_NE(bench.cycles(too_few).command.reason, Reason::kObstacle);
  EXPECT_EQ(bench.cycle().command.reason, Reason::kObstacle);
}

TEST(ArbiterEdge, ASpeedThatNoSourceAsksForIsNobodys) {
  ArbiterBench bench;
  bench.speed = 20.0;
  bench.drive();
  EXPECT_EQ(bench.cycle().speed_source, Source::kNone);
}

// Where the corridor's left edge ends of a truck in a bend, which turns by this share of what its hinge
// says.
double endOfCorridor(double share) {
  ArbiterBench bench;
  bench.wanted = bench.motion.articulation = 0.2;
  bench.motion.yaw_rate = share * vehicle::yawRate(bench.truck.geometry, 3.0, 0.2, 0.0);
  bench.drive();
  return bench.cycles(100).corridor_left.back().y();
}

TEST(ArbiterEdge, ATruckSeenToTurnLessThanItsHingeIsExpectedToGoWider) {
  EXPECT_LT(endOfCorridor(0.8), endOfCorridor(1.0) - 0.05);
}

TEST(ArbiterEdge, AfterAClockJumpTheFirstScanAloneSaysHowFarTheWayIsFree) {
  for (const double speed : {0.0, 3.0}) {
    ArbiterBench bench;
    bench.motion.speed = speed;
    bench.cycles(5);
    bench.arbiter->clockJumped();
    bench.obstacle = 6.0;
    const double free = bench.cycle().free_distance;
    EXPECT_LT(free, 6.0) << speed;
    EXPECT_GT(free, 1.0) << speed;
  }
}

TEST(ArbiterEdge, AfterAClockJumpTheTruckTurnsAsItsHingeSaysUntilSeenOtherwise) {
  ArbiterBench bench;
  bench.wanted = bench.motion.articulation = 0.2;
  const double whole = vehicle::yawRate(bench.truck.geometry, 3.0, 0.2, 0.0);
  bench.motion.yaw_rate = 0.8 * whole;
  bench.drive();
  bench.cycles(100);
  bench.arbiter->clockJumped();
  bench.motion.yaw_rate = whole;
  EXPECT_NEAR(bench.cycles(3).corridor_left.back().y(), endOfCorridor(1.0), 0.01);
}

// The centerline stays where it was measured, though the truck and what it sees turn away from it.
TEST(ArbiterEdge, WithoutANewCenterlineTheWayIsExpectedAlongTheOneLastMeasured) {
  const auto endOfCorridorTurnedBy = [](double turn) {
    ArbiterBench bench;
    bench.drive();
    bench.tunnel_valid = false;
    for (int cycle = 0; cycle < 6; ++cycle) {
      bench.motion.pose.heading += turn / 6.0;
      bench.cycle();
    }
    return bench.cycle().corridor_left.back().y();
  };
  EXPECT_LT(endOfCorridorTurnedBy(0.12), endOfCorridorTurnedBy(0.0) - 0.1) << "back to the right";
}

TEST(ArbiterEdge, AHeldArticulationIsOfTheTimeOfTheLastMotionAndWithoutAnyOfNone) {
  ArbiterBench bench;
  EXPECT_EQ(bench.arbiter->decide(bench.now).command.stamp, Stamp{});
  bench.give_proposal = bench.give_scan = false;
  const Command& command = bench.cycle().command;
  ASSERT_EQ(command.source, Source::kHold);
  EXPECT_EQ(command.stamp, bench.now);
  bench.arbiter->clockJumped();
  EXPECT_EQ(bench.arbiter->decide(bench.now).command.stamp, Stamp{});
}

TEST(ArbiterEdge, BetweenScansTheWayDrivenShortensTheFreeOneDownToNothing) {
  ArbiterBench bench;
  bench.obstacle = 8.0;
  bench.drive();
  const double free = bench.cycle().free_distance;
  bench.give_scan = false;
  EXPECT_NEAR(bench.cycles(10).free_distance, free - 10 * 3.0 * 0.02, 1e-9);
  EXPECT_EQ(bench.cycles(200).free_distance, 0.0);
}

TEST(ArbiterEdge, AScanFromBeforeTheMotionIsNotCompared) {
  ArbiterBench bench;
  bench.latency = milliseconds(500);
  EXPECT_TRUE(std::isnan(bench.cycles(5).free_distance));
}

TEST(ArbiterEdge, AnObstacleWithinTheReserveStopsATruckThatStands) {
  for (const double beyond : {-0.1, 0.1}) {
    ArbiterBench bench;
    bench.motion.speed = 0.0;
    bench.obstacle = bench.truck.geometry.front_overhang + bench.parameters.envelope.reserve + beyond;
    bench.drive();
    EXPECT_EQ(bench.cycle().command.stop, beyond < 0.0) << beyond;
  }
}

TEST(ArbiterEdge, DeadReckoningSteersFromWhereTheTruckIsOnceTheSteeringAnswers) {
  ArbiterBench bench;
  bench.drive();
  bench.tunnel_valid = bench.proposal_valid = false;
  bench.motion.yaw_rate = 0.05;
  const Decision& decision = bench.cycles(20);
  ASSERT_EQ(decision.command.source, Source::kDeadReckoning);
  const geometry::Pose ahead = drivers::advanced(
      geometry::Pose(), 3.0, 0.05, bench.truck.steering.dead_time + bench.truck.steering.lag);
  const drivers::PathFollowerGains& gains = bench.parameters.envelope.follower;
  EXPECT_NEAR(decision.command.articulation_angle,
              -gains.offset * ahead.y - gains.heading * ahead.heading, 1e-4);
}

// ---- what stops, and for how long

TEST(ArbiterEdge, WhereTheTruckHasNoStatesStartingUpIsNoLatchedStop) {
  ArbiterBench bench(false);
  EXPECT_EQ(bench.arbiter->decide(bench.now).command.reason, Reason::kStartUp);
  EXPECT_EQ(bench.cycles(10).command.reason, Reason::kNone);
}

TEST(ArbiterEdge, WhereTheTruckHasNoStatesAStopStaysTooWhenItsCauseIsGone) {
  ArbiterBench bench(false);
  bench.drive();
  bench.give_scan = false;
  ASSERT_EQ(bench.cycles(30).command.reason, Reason::kScanStale);
  bench.give_scan = true;
  EXPECT_EQ(bench.cycles(100).command.reason, Reason::kScanStale);
}

TEST(ArbiterEdge, BeforeAnyMotionAResetIsRefused) {
  ArbiterBench bench(false);
  EXPECT_FALSE(bench.arbiter->reset(bench.now));
}

TEST(ArbiterEdge, AtRestAResetIsRefusedWhileSomethingStops) {
  ArbiterBench bench(false);
  bench.drive();
  bench.motion.speed = 0.0;
  bench.give_proposal = false;
  EXPECT_TRUE(bench.cycles(20).command.stop);
  EXPECT_FALSE(bench.arbiter->reset(bench.now));
}

TEST(ArbiterEdge, WithoutWallChecksAScanThatStaysAwayStopsAllTheSame) {
  ArbiterBench bench;
  bench.parameters.wall_checks = false;
  startAnew(bench);
  bench.drive();
  bench.give_scan = false;
  bench.latency = Stamp::zero();  // a driver that needs none
  const int cycles = static_cast<int>(bench.parameters.scan_stop_age / 0.02);
  EXPECT_FALSE(bench.cycles(cycles - 5).command.stop);
  const Decision& decision = bench.cycles(6);
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kScanStale);
}

TEST(ArbiterEdge, WithoutWallChecksScansOfLongAgoStopHoweverManyCome) {
  ArbiterBench bench;
  bench.parameters.wall_checks = false;
  startAnew(bench);
  bench.drive();
  bench.latency = fromSeconds(bench.parameters.scan_stop_age) + milliseconds(40);
  bench.give_proposal = false;
  bench.inputs();
  const Stamp measured = bench.now;  // a driver that needs no scan
  bench.arbiter->setProposal(
      Source::kPreviewDriver,
      [&] {
        drivers::Proposal proposal = bench.proposal();
        proposal.stamp = measured;
        return proposal;
      }(),
      bench.now);
  const Decision& decision = bench.arbiter->decide(bench.now);
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kScanStale);
}

TEST(ArbiterEdge, AStoppingTrucksReasonIsToldHoweverSlight) {
  ArbiterBench bench;
  bench.drive();
  bench.state = {true, true, Reason::kNotEngaged};
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kNotEngaged);
}

TEST(ArbiterEdge, AnObstacleIsToldAsOneAmongScansThatShowTooLittleRoom) {
  ArbiterBench bench;
  bench.parameters.wall_scans = 2;
  startAnew(bench);
  bench.drive();
  bench.narrow = 3.0;
  bench.cycle();
  bench.narrow.reset();
  bench.obstacle = 3.0;
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kObstacle);
}

TEST(ArbiterEdge, ATruckThatWaitsForAFreeWayIsHeldByNoSource) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.obstacle = bench.truck.geometry.front_overhang + bench.parameters.envelope.reserve + 0.1;
  bench.drive();
  bench.obstacle.reset();
  const Decision& decision = bench.cycles(10);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kObstacle);
  EXPECT_EQ(decision.speed_source, Source::kNone);
}

TEST(ArbiterEdge, APauseOfTheClockUpToItsLimitIsNoJump) {
  ArbiterBench bench;
  bench.drive();
  const Stamp later = bench.now + fromSeconds(bench.parameters.clock_jump);
  EXPECT_NE(bench.arbiter->decide(later).command.reason, Reason::kClockJump);
}

TEST(ArbiterEdge, AStopOutlastsTheTrucksResetByTheRecoveryTime) {
  ArbiterBench bench;
  bench.drive();
  bench.proposal_valid = false;
  ASSERT_TRUE(bench.cycle().command.stop);
  bench.proposal_valid = true;
  bench.state = {false, false, Reason::kNotEngaged};
  const int cycles = static_cast<int>(bench.parameters.recovery_time / 0.02);
  EXPECT_TRUE(bench.cycles(cycles - 1).command.stop);
  EXPECT_FALSE(bench.cycles(5).command.stop);
}

TEST(ArbiterEdge, AClockThatJumpsWhileNobodyIsEngagedLatchesNothing) {
  ArbiterBench bench;
  bench.cycles(10);
  bench.arbiter->clockJumped();
  EXPECT_EQ(bench.cycles(10).command.reason, Reason::kNotEngaged);
}

TEST(ArbiterEdge, AClockThatJumpsInAStopLeavesItsReason) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->requestStop(bench.now);
  bench.cycle();
  bench.arbiter->clockJumped();
  EXPECT_EQ(bench.cycles(10).command.reason, Reason::kOperatorStop);
}

TEST(ArbiterEdge, AfterAClockThatJumpedBackAStopDoesNotOutlastTheTrucksReset) {
  ArbiterBench bench;
  bench.drive();
  bench.arbiter->requestStop(bench.now);
  bench.cycle();
  bench.now -= std::chrono::hours(1);
  bench.cycle();
  bench.state = {false, false, Reason::kNotEngaged};
  const int cycles = static_cast<int>(bench.parameters.recovery_time / 0.02);
  EXPECT_FALSE(bench.cycles(cycles + 5).command.stop);
}

// ---- speed

TEST(ArbiterEdge, WithoutWallChecksTheEndOfTheCenterlineLimitsTheSpeed) {
  ArbiterBench bench;
  bench.parameters.wall_checks = false;
  startAnew(bench);
  bench.speed = 9.0;
  bench.drive();
  const Decision& decision = bench.cycle();
  EXPECT_FALSE(decision.command.stop);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kSight);
  EXPECT_TRUE(std::isnan(decision.clearance_left));
  EXPECT_TRUE(std::isnan(decision.free_distance));
}

TEST(ArbiterEdge, WithoutWallChecksTheWayDrivenBringsTheEndOfTheCenterlineNearer) {
  ArbiterBench bench;
  bench.parameters.wall_checks = false;
  startAnew(bench);
  bench.speed = 9.0;
  bench.drive();
  const double before = bench.cycles(1000).command.speed;
  bench.give_scan = false;
  const Decision& decision = bench.cycles(4);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kSight);
  EXPECT_LT(decision.command.speed, before);
}

TEST(ArbiterEdge, ATopSpeedIsALimitOfNothingElse) {
  ArbiterBench bench;
  bench.parameters.governor.max_speed = 1.0;
  startAnew(bench);
  bench.motion.speed = 1.0;
  bench.drive();
  const Decision& decision = bench.cycle();
  EXPECT_EQ(decision.speed_limit, 1.0);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kNone);
}

TEST(ArbiterEdge, ADegradedDriveIsNoFasterThanItsDriverWants) {
  ArbiterBench bench;
  bench.speed = 1.0;
  bench.motion.speed = 1.0;
  bench.drive();
  drivers::Proposal unsure = bench.proposal();
  unsure.confidence = 0.0;
  bench.arbiter->setProposal(Source::kLidarDriver, unsure, bench.now);
  const Decision& decision = bench.cycle();
  EXPECT_TRUE(decision.degraded);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kDriver);
}

TEST(ArbiterEdge, AnObstacleFarAheadDoesNotKeepAStandingTruck) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.obstacle = 6.0;
  bench.speed = 9.0;
  bench.drive();
  const Decision& decision = bench.cycles(20);
  EXPECT_EQ(decision.limited_by, SpeedLimit::kObstacle);
  EXPECT_GT(decision.command.speed, 0.0);
  EXPECT_EQ(decision.command.reason, Reason::kNone);
}

TEST(ArbiterEdge, StandingAtTheEndOfSightSaysSo) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.drive();
  bench.give_scan = false;
  Decision decision;
  for (int i = 0; i < 5; ++i) {
    bench.scene = sceneAt(bench.line, {20.0, 0.0, 0.0}, 5.0, bench.now, 3.0);
    bench.arbiter->setPoints(bench.scene.points, bench.now, bench.now);
    bench.arbiter->setWalls(bench.scene.walls, bench.now);
    bench.arbiter->setTunnel(bench.scene.tunnel, bench.now);
    decision = bench.cycle();
  }
  EXPECT_FALSE(decision.command.stop);
  EXPECT_EQ(decision.command.reason, Reason::kTunnelInvalid);
}

TEST(ArbiterEdge, StandingBecauseTheDriverWantsToNeedsNoReason) {
  ArbiterBench bench;
  bench.motion.speed = 0.0;
  bench.speed = 0.0;
  bench.drive();
  EXPECT_EQ(bench.cycle().command.reason, Reason::kNone);
}

TEST(ArbiterEdge, EveryReasonIsOfSomeGravity) {
  for (int code = 1; code <= static_cast<int>(Reason::kProcessSilent); ++code) {
    EXPECT_GT(gravity(static_cast<Reason>(code)), 0) << code;
  }
}

// ---- limits

TEST(ArbiterEdge, LateralAccelerationLimitedAgainAndAgainDegrades) {
  ArbiterBench bench;
  bench.motion.speed = 6.0;
  bench.drive();
  bench.wanted = 0.6;  // a possible angle, but not at this speed
  EXPECT_EQ(bench.cycles(6).command.reason, Reason::kLimitsHit);
}

TEST(ArbiterEdge, LimitsHitWhileNobodyIsEngagedDoNotCount) {
  ArbiterBench bench;
  bench.wanted = 0.9;
  bench.cycles(20);
  bench.wanted = 0.0;
  bench.state = {true, false, Reason::kNone};
  EXPECT_FALSE(bench.cycle().degraded);
}

TEST(ArbiterEdge, LimitsHitLongAgoDoNotCount) {
  ArbiterBench bench;
  bench.drive();
  bench.wanted = 0.9;
  const int hits = bench.parameters.limit_hits - 1;
  EXPECT_FALSE(bench.cycles(hits).degraded);
  bench.wanted = 0.0;
  bench.cycles(static_cast<int>(bench.parameters.recovery_time / 0.02) + 2);
  bench.wanted = 0.9;
  EXPECT_FALSE(bench.cycles(hits + 1).degraded);  // told one cycle after the last
  EXPECT_TRUE(bench.cycle().degraded);
}

TEST(Codes, ExactlyThoseThatHaveWordsAreKnown) {
  for (int number = 0; number < 256; ++number) {
    EXPECT_EQ(toString(static_cast<Mode>(number)) != "unknown mode", isKnown(static_cast<Mode>(number)));
    EXPECT_EQ(toString(static_cast<Source>(number)) != "unknown source",
              isKnown(static_cast<Source>(number)));
    EXPECT_EQ(toString(static_cast<Reason>(number)) != "unknown reason",
              isKnown(static_cast<Reason>(number)));
  }
}

}  // namespace
}  // namespace tunnel_pilot::supervision
