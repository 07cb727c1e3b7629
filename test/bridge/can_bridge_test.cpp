#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <random>
#include <string>

#include "rig.h"

// The way up and down, commands, frames. What the watchdogs find: can_bridge_watch_test.cpp; its status:
// can_bridge_status_test.cpp.
namespace tunnel_pilot::bridge {
namespace {

using supervision::Command;
using supervision::Reason;

constexpr double kDeg = 3.14159265358979323846 / 180.0;

class CanBridgeTest : public testing::Test {
 protected:
  void TearDown() override {
    for (const std::string& complaint : rig.judge.complaints)
      ADD_FAILURE() << "unsafe frame: " << complaint;
  }
  Rig rig;
};

/// In this state, on the usual way to it.
std::unique_ptr<Rig> rigIn(SafetyState wanted) {
  auto rig = std::make_unique<Rig>();
  rig->run(wanted == SafetyState::kInit ? 0.5 : 1.5);
  if (wanted == SafetyState::kArmed) rig->bridge->engage(rig->now), rig->run(0.03);
  if (wanted >= SafetyState::kActive) rig->drive();
  if (wanted == SafetyState::kDegraded) rig->measurement_age = ms(170), rig->run(0.1);
  if (wanted >= SafetyState::kStopping) rig->bridge->stop(rig->now), rig->run(0.1);
  if (wanted == SafetyState::kStopped) rig->run(10.0, [&] { return rig->state() == wanted; });
  EXPECT_EQ(rig->state(), wanted);
  return rig;
}

void expectRefusal(const CanBridge::Answer& answer, const std::string& why) {
  EXPECT_FALSE(answer.accepted) << why;
  EXPECT_EQ(answer.reason, why);
}

TEST_F(CanBridgeTest, LeavesInitOnlyAfterOneSecondOfHealth) {
  rig.run(0.98);
  EXPECT_EQ(rig.state(), SafetyState::kInit);
  rig.run(0.1);
  EXPECT_EQ(rig.state(), SafetyState::kStandby);
}

TEST_F(CanBridgeTest, NeverEngagesByItself) {
  rig.run(60.0);
  EXPECT_EQ(rig.state(), SafetyState::kStandby);
  EXPECT_EQ(rig.plant.state().speed, 0.0);
}

TEST_F(CanBridgeTest, RefusesToEngageBeforeOneSecondOfHealthAndSaysWhy) {
  EXPECT_FALSE(rig.bridge->engage(rig.now).accepted);
  rig.run(1.2);
  rig.arbiter_alive = false;
  rig.run(0.2);
  expectRefusal(rig.bridge->engage(rig.now), "command stale");
  rig.arbiter_alive = true;
  rig.run(0.9);
  expectRefusal(rig.bridge->engage(rig.now), "inputs not healthy for long enough");
  rig.run(0.2);
  EXPECT_TRUE(rig.bridge->engage(rig.now).accepted);
  expectRefusal(rig.bridge->engage(rig.now), "already engaged");
}

TEST_F(CanBridgeTest, RefusesToEngageWhileTheArbiterSeesNoTunnel) {
  rig.command.stop = true;
  rig.command.reason = Reason::kTunnelInvalid;
  rig.run(2.0);
  expectRefusal(rig.bridge->engage(rig.now), "no valid tunnel");
}

TEST_F(CanBridgeTest, RefusesToEngageBeforeAWallOrAnObstacle) {
  rig.command.stop = true;
  for (const Reason reason : {Reason::kClearance, Reason::kObstacle}) {
    rig.command.reason = reason;
    rig.run(2.0);
    expectRefusal(rig.bridge->engage(rig.now), supervision::toString(reason));
  }
}

TEST_F(CanBridgeTest, RefusesToEngageWithoutABus) {
  rig.run(1.5);
  rig.bridge_side.setState(can::BusState::kBusOff);
  expectRefusal(rig.bridge->engage(rig.now), "bus fault");
}

TEST(CanBridgeAnswers, EngageIsRefusedInEveryStateButStandby) {
  const std::string stopped = "stopped: stopped by the operator; reset first";
  for (const auto& [state, why] : std::map<SafetyState, std::string>{
           {SafetyState::kInit, "starting up: inputs not healthy for long enough"},
           {SafetyState::kArmed, "already engaged"},
           {SafetyState::kActive, "already engaged"},
           {SafetyState::kDegraded, "already engaged"},
           {SafetyState::kStopping, stopped},
           {SafetyState::kStopped, stopped}}) {
    const auto rig = rigIn(state);
    expectRefusal(rig->bridge->engage(rig->now), why);
    EXPECT_EQ(rig->state(), state);
  }
}

TEST(CanBridgeAnswers, ResetIsRefusedInEveryStateButStopped) {
  for (const auto& [state, why] :
       std::map<SafetyState, std::string>{{SafetyState::kInit, "not stopped"},
                                          {SafetyState::kStandby, "not stopped"},
                                          {SafetyState::kArmed, "not stopped"},
                                          {SafetyState::kActive, "not stopped"},
                                          {SafetyState::kDegraded, "not stopped"},
                                          {SafetyState::kStopping, "still stopping"}}) {
    const auto rig = rigIn(state);
    rig->run(0.05);
    expectRefusal(rig->bridge->reset(rig->now), why);
    EXPECT_EQ(rig->state(), state);
  }
}

TEST(CanBridgeAnswers, ReleaseIsRefusedWhereNobodyIsEngaged) {
  for (const SafetyState state :
       {SafetyState::kInit, SafetyState::kStandby, SafetyState::kStopping, SafetyState::kStopped}) {
    const auto rig = rigIn(state);
    expectRefusal(rig->bridge->release(rig->now), "not engaged");
  }
}

TEST(CanBridgeAnswers, AStopIsAcceptedInEveryState) {
  for (const SafetyState state :
       {SafetyState::kInit, SafetyState::kStandby, SafetyState::kArmed, SafetyState::kActive,
        SafetyState::kDegraded, SafetyState::kStopping, SafetyState::kStopped}) {
    const auto rig = rigIn(state);
    EXPECT_TRUE(rig->bridge->stop(rig->now).accepted) << toString(state);
  }
}

TEST_F(CanBridgeTest, FirstFramesAfterEngagingAreNotIntendedToSteer) {
  rig.run(1.5);
  const std::size_t before = rig.judge.commands.size();
  ASSERT_TRUE(rig.bridge->engage(rig.now).accepted);
  rig.run(1.0, [&] { return rig.judge.last->steering_enable; });
  EXPECT_GE(rig.judge.commands.size() - before, 5u);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
}

TEST_F(CanBridgeTest, ArmsInVainWhileTheArbiterHoldsItsStop) {
  rig.command.stop = true;
  rig.command.reason = Reason::kNotEngaged;
  rig.run(1.5);
  ASSERT_TRUE(rig.bridge->engage(rig.now).accepted);
  rig.run(1.9);
  EXPECT_EQ(rig.state(), SafetyState::kArmed);
  rig.command.reason = Reason::kObstacle;
  rig.run(0.2);
  EXPECT_EQ(rig.state(), SafetyState::kStandby);
  EXPECT_EQ(rig.reason(), Reason::kObstacle);
}

TEST_F(CanBridgeTest, DrivesTheTruckToTheCommandedSpeedAndArticulation) {
  rig.drive(3.0);
  rig.command.articulation_angle = 12.0 * kDeg;
  rig.run(6.0);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
  EXPECT_NEAR(rig.plant.state().speed, 3.0, 0.05);
  EXPECT_NEAR(rig.plant.state().articulation, 12.0 * kDeg, 0.01 * kDeg);
  EXPECT_TRUE(rig.bridge->status().autonomy_enabled);
}

TEST_F(CanBridgeTest, AStopKeepsItsCommandsModeAndAsksForNoSpeed) {
  rig.run(1.5);
  EXPECT_EQ(rig.judge.last->mode, static_cast<std::uint8_t>(supervision::Mode::kStandby));
  rig.drive();
  rig.bridge->stop(rig.now);
  rig.run(0.1);
  ASSERT_EQ(rig.state(), SafetyState::kStopping);
  ASSERT_TRUE(rig.judge.last->steering_enable);
  EXPECT_EQ(rig.judge.last->mode, static_cast<std::uint8_t>(supervision::Mode::kAutonomous));
  EXPECT_EQ(rig.judge.last->speed, 0.0);
  EXPECT_NEAR(rig.judge.last->acceleration, Rig::bridgeParameters().stop_deceleration, 0.01);
}

TEST_F(CanBridgeTest, BeforeAnyCommandItTellsItsOwnReason) {
  rig.arbiter_alive = false;
  rig.run(0.1);
  EXPECT_EQ(rig.judge.last->reason, static_cast<std::uint8_t>(Reason::kStartUp));
  EXPECT_TRUE(std::isinf(rig.bridge->status().command_age));
  rig.arbiter_alive = true;
  rig.run(0.1);
  EXPECT_LT(rig.bridge->status().command_age, 0.03);
}

TEST_F(CanBridgeTest, RepeatsTheLastCommandEveryTwentyMilliseconds) {
  rig.drive();
  const std::size_t before = rig.judge.times.size();
  rig.run(1.0);
  EXPECT_NEAR(static_cast<double>(rig.judge.times.size() - before), 50.0, 1.0);
}

TEST_F(CanBridgeTest, TellsTheMeasurementStampModulo65536Milliseconds) {
  rig.drive();
  rig.measurement = rig.now - ms(10);
  rig.run(0.05);
  const auto milliseconds =
      std::chrono::duration_cast<std::chrono::milliseconds>(*rig.measurement).count();
  EXPECT_EQ(rig.judge.last_info->measurement_stamp_ms, milliseconds % 65536);
  EXPECT_EQ(rig.controller->measurementStamp(), rig.judge.last_info->measurement_stamp_ms);
}

TEST_F(CanBridgeTest, LimitsTheRateOfAStepInTheCommand) {
  rig.drive();
  rig.command.articulation_angle = 40.0 * kDeg;
  const double start = rig.judge.last->articulation_angle;
  rig.run(1.0);
  EXPECT_NEAR(rig.judge.last->articulation_angle - start, 15.0 * kDeg, 0.5 * kDeg);
  rig.run(3.0);
  EXPECT_NEAR(rig.judge.last->articulation_angle, 40.0 * kDeg, 0.01 * kDeg);
}

TEST_F(CanBridgeTest, AClockThatRunsAheadALittleTurnsByOneTickAtMost) {
  rig.drive();
  rig.command.articulation_angle = 40.0 * kDeg;
  rig.run(0.2);
  const std::size_t before = rig.judge.times.size();
  rig.run(0.1, [&] { return rig.judge.times.size() > before; });
  const double start = rig.judge.last->articulation_angle;
  rig.now += ms(5);
  rig.bridge->tick(rig.now + ms(15));  // a frame is due by this clock
  rig.pump();
  ASSERT_EQ(rig.judge.times.size(), before + 2);
  EXPECT_NEAR(rig.judge.last->articulation_angle - start, 15.0 * kDeg * 0.005, 0.01 * kDeg);
}

TEST_F(CanBridgeTest, StartsToSteerFromTheMeasuredAngle) {
  rig.plant.reset(geometry::Pose(), 20.0 * kDeg, 0.0);
  rig.command.articulation_angle = -20.0 * kDeg;
  rig.run(1.5);
  ASSERT_TRUE(rig.bridge->engage(rig.now).accepted);
  rig.run(1.0, [&] { return rig.judge.last->steering_enable; });
  EXPECT_NEAR(rig.judge.last->articulation_angle, 20.0 * kDeg, 0.32 * kDeg);
}

// A hinge that is turned by hand, 1 deg in each frame of the truck.
TEST_F(CanBridgeTest, StartsToSteerFromTheAngleMeasuredLast) {
  rig.run(1.5);
  ASSERT_TRUE(rig.bridge->engage(rig.now).accepted);
  double told = 0.0;
  rig.to_bridge = [&, start = rig.now](const can::Frame& frame) {
    auto feedback = can::decode<can::TruckFeedbackFrame>(frame);
    if (!feedback) return std::optional<can::Frame>(frame);
    told = feedback->articulation_angle = 50.0 * kDeg * toSeconds(rig.now - start);
    return can::encode(*feedback);
  };
  rig.run(1.0, [&] { return rig.judge.last->steering_enable; });
  ASSERT_GT(told, 4.0 * kDeg);
  EXPECT_NEAR(rig.judge.last->articulation_angle, told, 0.32 * kDeg);
}

TEST_F(CanBridgeTest, WhileItDoesNotSteerItTellsTheMeasuredAngle) {
  rig.plant.reset(geometry::Pose(), 5.0 * kDeg, 0.0);
  rig.command.articulation_angle = 20.0 * kDeg;
  rig.run(1.5);
  EXPECT_NEAR(rig.judge.last->articulation_angle, 5.0 * kDeg, 0.01 * kDeg);
}

TEST_F(CanBridgeTest, SendsASlowCommandAsItIs) {
  rig.command.acceleration = 0.4;
  rig.drive(0.5);
  EXPECT_NEAR(rig.judge.last->speed, 0.5, 0.001);
  EXPECT_NEAR(rig.judge.last->acceleration, 0.4, 0.001);
}

TEST_F(CanBridgeTest, WhileDrivingTheFrameTellsTheCommandsReason) {
  rig.drive();
  rig.command.reason = Reason::kObstacle;
  rig.run(0.1);
  ASSERT_EQ(rig.reason(), Reason::kNone) << "no reason to change the state";
  EXPECT_EQ(rig.judge.last->reason, static_cast<int>(Reason::kObstacle));
}

TEST_F(CanBridgeTest, TellsTheCommandsSource) {
  rig.drive();
  EXPECT_EQ(rig.judge.last_info->source, static_cast<int>(supervision::Source::kPreviewDriver));
}

TEST_F(CanBridgeTest, AHoldTellsTheStampOfTheTrucksFrame) {
  rig.drive(5.0);
  rig.arbiter_alive = false;
  rig.timeToStop();
  rig.run(0.5);
  ASSERT_EQ(rig.judge.last_info->source, static_cast<int>(supervision::Source::kHold));
  const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(rig.now).count();
  const auto age = static_cast<std::uint16_t>(now - rig.judge.last_info->measurement_stamp_ms);
  EXPECT_LE(age, 46) << "20 ms old, read 5 ms later, repeated 20 ms later";
}

TEST(CanBridgeRate, NeverSendsMoreThanSixteenFramesInAQuarterSecond) {
  Rig rig(0.001);
  rig.run(1.5);
  for (int i = 0; i < 500; ++i) {  // a stop that comes and goes would be told each time it comes
    rig.command.stop = i % 3 == 0;
    Command flapping = rig.command;
    flapping.stamp = rig.now;
    flapping.sequence = 1u << 20;
    rig.bridge->setCommand(flapping, rig.now);
    rig.pump();
    rig.run(0.001);
  }
  EXPECT_TRUE(rig.judge.complaints.empty()) << rig.judge.complaints.front();
}

// -------- commands

class RefusedCommand : public CanBridgeTest,
                       public testing::WithParamInterface<void (*)(Command&, Stamp)> {};

TEST_P(RefusedCommand, IsCountedAndNeverSent) {
  rig.drive();
  const std::uint32_t before = rig.bridge->status().commands_rejected;
  Command bad = rig.command;
  bad.stamp = rig.now;
  bad.sequence = 1u << 20;
  GetParam()(bad, rig.now);
  rig.bridge->setCommand(bad, rig.now);
  rig.run(0.05);
  EXPECT_EQ(rig.bridge->status().commands_rejected, before + 1);
  EXPECT_LT(rig.judge.last_info->sequence, 1u << 20);
  EXPECT_EQ(rig.state(), SafetyState::kActive) << "one bad command among good ones does no harm";
}

TEST_P(RefusedCommand, StopsThoughRefusedWhenItAsksForAStop) {
  rig.drive();
  Command bad = rig.command;
  bad.stamp = rig.now;
  bad.sequence = 1u << 20;
  GetParam()(bad, rig.now);
  bad.stop = true;
  bad.reason = supervision::Reason::kObstacle;
  rig.judge.stopAsked(rig.now);
  rig.bridge->setCommand(bad, rig.now);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
  EXPECT_EQ(rig.bridge->status().reason, supervision::Reason::kObstacle);
  rig.run(0.3);
}

INSTANTIATE_TEST_SUITE_P(
    All, RefusedCommand,
    testing::Values([](Command& c, Stamp) { c.articulation_angle = std::nan(""); },
                    [](Command& c, Stamp) { c.speed = std::nan(""); },
                    [](Command& c, Stamp) { c.acceleration = std::nan(""); },
                    [](Command& c, Stamp) { c.speed = std::numeric_limits<double>::infinity(); },
                    [](Command& c, Stamp) {
                      c.articulation_angle = -std::numeric_limits<double>::infinity();
                    },
                    [](Command& c, Stamp) { c.articulation_angle = 45.1 * kDeg; },
                    [](Command& c, Stamp) { c.articulation_angle = -45.1 * kDeg; },
                    [](Command& c, Stamp) { c.speed = -0.1; }, [](Command& c, Stamp) { c.speed = 9.8; },
                    [](Command& c, Stamp) { c.acceleration = -0.1; },
                    [](Command& c, Stamp) { c.acceleration = 3.1; },
                    [](Command& c, Stamp) { c.speed = -1.05e-6; },
                    [](Command& c, Stamp) { c.speed = Rig::bridgeParameters().max_speed + 1.05e-6; },
                    [](Command& c, Stamp now) { c.stamp = now + ms(51); },
                    [](Command& c, Stamp) { c.sequence = 0; }));

TEST_F(CanBridgeTest, TakesCommandsAtTheLimits) {
  rig.run(1.5);
  const BridgeParameters parameters = Rig::bridgeParameters();
  for (const double side : {-1.0, 1.0}) {
    Command command = rig.command;
    command.sequence = 1u << 20;
    command.stamp = rig.now;
    command.articulation_angle = side * Rig::truckParameters().geometry.max_articulation;
    command.speed = side < 0.0 ? 0.0 : parameters.max_speed;
    command.acceleration = side < 0.0 ? 0.0 : parameters.max_acceleration;
    rig.bridge->setCommand(command, rig.now);
    EXPECT_EQ(rig.bridge->status().command_rejection, "");
  }
}

TEST_F(CanBridgeTest, TakesCommandsBeyondTheLimitsByRounding) {
  Command command = rig.command;
  command.stamp = rig.now;
  command.speed = -1e-6;
  command.acceleration = Rig::bridgeParameters().max_acceleration + 1e-6;
  rig.bridge->setCommand(command, rig.now);
  EXPECT_EQ(rig.bridge->status().command_rejection, "");
}

TEST_F(CanBridgeTest, TakesAStampAsFarAheadAsIsTolerated) {
  Command command = rig.command;
  command.stamp = rig.now + ms(50);
  rig.bridge->setCommand(command, rig.now);
  EXPECT_EQ(rig.bridge->status().command_rejection, "");
}

TEST_F(CanBridgeTest, RefusesAnAngleThatNoFrameTellsThoughTheTruckTurnsSoFar) {
  vehicle::TruckGeometry wide = Rig::truckParameters().geometry;
  wide.max_articulation = 50.0 * kDeg;
  CanBridge bridge(Rig::bridgeParameters(), wide, *rig.bridge_end);
  Command command = rig.command;
  command.stamp = rig.now;
  command.articulation_angle = 45.0 * kDeg;
  bridge.setCommand(command, rig.now);
  EXPECT_EQ(bridge.status().command_rejection, "");
  command.articulation_angle = 45.1 * kDeg;
  bridge.setCommand(command, rig.now);
  EXPECT_EQ(bridge.status().command_rejection, "articulation angle out of range");
}

TEST_F(CanBridgeTest, ARefusedCommandsStopIsOnTheBusWithinTheCall) {
  rig.drive();
  Command bad = rig.command;
  bad.stop = true;
  bad.speed = -1.0;
  rig.bridge->setCommand(bad, rig.now);
  rig.pump();
  EXPECT_TRUE(rig.judge.last->stop);
}

TEST_F(CanBridgeTest, TakesACommandThatComesTwiceWhileDriving) {
  rig.drive();
  Command command = rig.command;
  command.sequence = 1u << 20;
  command.stamp = rig.now;
  rig.bridge->setCommand(command, rig.now);
  rig.bridge->setCommand(command, rig.now);
  EXPECT_EQ(rig.bridge->status().commands_rejected, 0u);
}

TEST_F(CanBridgeTest, ACommandThatComesTwiceIsToldByItsNumber) {
  rig.drive();
  rig.arbiter_alive = false;
  Command command = rig.command;
  command.sequence = 1u << 20;
  command.stamp = rig.now;
  rig.bridge->setCommand(command, rig.now);
  rig.bridge->setCommand(command, rig.now);
  rig.runToSet();
  EXPECT_EQ(rig.judge.last_info->sequence, 1u << 20);
}

TEST_F(CanBridgeTest, AnArbiterThatStartedAgainCountsOnFromTheNumberToldLast) {
  rig.run(1.5);
  rig.arbiter_alive = false;
  rig.runToSet();
  const std::uint32_t before = rig.judge.last_info->sequence;
  Command command = rig.command;
  command.stamp = rig.now;
  for (const std::uint32_t number : {7, 8}) {  // its first were not heard
    command.sequence = number;
    rig.bridge->setCommand(command, rig.now);
    rig.runToSet();
    EXPECT_EQ(rig.judge.last_info->sequence, before + number - 6);
  }
}

TEST_F(CanBridgeTest, AnArbiterThatStartedAgainMayNotCountBackwardsWhileDriving) {
  rig.command.sequence = 1000;
  rig.run(1.5);
  rig.command.sequence = 0;  // starts again
  rig.drive();
  Command command = rig.command;
  command.stamp = rig.now;
  rig.bridge->setCommand(command, rig.now);
  EXPECT_EQ(rig.bridge->status().command_rejection, "sequence decreases");
}

TEST_F(CanBridgeTest, TakesAnArbiterThatStartedAgainOnlyWhenNotDriving) {
  rig.drive();
  rig.bridge->stop(rig.now);
  rig.run(10.0, [&] { return rig.state() == SafetyState::kStopped; });
  rig.arbiter_alive = false;
  Command first = rig.command;
  first.sequence = 0;
  first.stamp = rig.now;
  const std::uint32_t sent = rig.judge.last_info->sequence;
  rig.bridge->setCommand(first, rig.now);
  rig.run(0.05);
  EXPECT_EQ(rig.judge.last_info->sequence, sent + 1) << "lifted above all before";
}

TEST_F(CanBridgeTest, AnArbiterThatStartsAgainWhileTheTruckStopsIsRefused) {
  rig.drive();
  rig.bridge->stop(rig.now);
  rig.arbiter_alive = false;
  ASSERT_EQ(rig.state(), SafetyState::kStopping);
  Command first = rig.command;
  first.sequence = 0;
  first.stamp = rig.now;
  rig.bridge->setCommand(first, rig.now);
  EXPECT_EQ(rig.bridge->status().command_rejection, "sequence decreases");
}

TEST_F(CanBridgeTest, ACommandWithACodeThatNobodyKnowsIsRefused) {
  const auto refusal = [this](const Command& command) {
    rig.bridge->setCommand(command, rig.now);
    return rig.bridge->status().command_rejection;
  };
  rig.run(1.5);
  rig.arbiter_alive = false;
  Command command = rig.command;
  command.sequence = 1u << 20;
  command.stamp = rig.now;
  command.mode = static_cast<supervision::Mode>(4);
  EXPECT_EQ("unknown mode", refusal(command));
  command.mode = supervision::Mode::kAutonomous;
  command.source = static_cast<supervision::Source>(9);
  EXPECT_EQ("unknown source", refusal(command));
  command.source = supervision::Source::kHold;
  command.reason = static_cast<Reason>(28);
  EXPECT_EQ("unknown reason", refusal(command));
  command.reason = Reason::kProcessSilent;
  command.mode = supervision::Mode::kTeleoperation;
  const auto rejected = rig.bridge->status().commands_rejected;
  rig.bridge->setCommand(command, rig.now);
  EXPECT_EQ(rejected, rig.bridge->status().commands_rejected) << "the last of each are known";
}

// A source above 15 has no room in TP_COMMAND_INFO: the set would break off behind the command.
TEST_F(CanBridgeTest, AStopWithCodesThatNobodyKnowsStopsAndItsSetsAreWhole) {
  rig.drive();
  Command command = rig.command;
  command.sequence = 1u << 20;
  command.stamp = rig.now;
  command.stop = true;
  command.source = static_cast<supervision::Source>(200);
  command.reason = static_cast<Reason>(250);
  rig.bridge->setCommand(command, rig.now);
  rig.pump();
  EXPECT_EQ(SafetyState::kStopping, rig.state());
  EXPECT_EQ(Reason::kProposalInvalid, rig.reason());
  EXPECT_TRUE(rig.judge.last->stop);
  EXPECT_EQ(rig.judge.last->counter, rig.judge.last_info->counter);
}

// -------- stopping

TEST_F(CanBridgeTest, OperatorsStopIsOnTheBusWithinTheCallInEveryState) {
  for (const SafetyState wanted : {SafetyState::kInit, SafetyState::kStandby, SafetyState::kArmed,
                                   SafetyState::kActive, SafetyState::kDegraded}) {
    const auto other = rigIn(wanted);
    other->bridge->stop(other->now);
    const auto frame = other->wire_to_bridge->receive();  // before any tick
    ASSERT_TRUE(frame) << toString(wanted);
    EXPECT_TRUE(can::decode<can::TruckCommandFrame>(*frame)->stop);
    EXPECT_TRUE(isStop(other->state()));
  }
}

TEST_F(CanBridgeTest, OperatorsReleaseIsOnTheBusWithinTheCall) {
  rig.drive();
  rig.judge.stopAsked(rig.now);
  rig.bridge->release(rig.now);
  rig.pump();
  EXPECT_TRUE(rig.judge.last->stop);
}

TEST_F(CanBridgeTest, ArbitersStopIsOnTheBusWithinTheCall) {
  rig.drive();
  Command stop = rig.command;
  stop.stop = true;
  stop.reason = Reason::kObstacle;
  stop.stamp = rig.now;
  stop.sequence = 1u << 20;
  rig.bridge->setCommand(stop, rig.now);
  EXPECT_TRUE(can::decode<can::TruckCommandFrame>(*rig.wire_to_bridge->receive())->stop);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
  EXPECT_EQ(rig.reason(), Reason::kObstacle);
}

TEST_F(CanBridgeTest, StopBrakesWhileItSteersAlongFreshCommands) {
  rig.drive(5.0);
  rig.command.stop = true;
  rig.command.articulation_angle = 8.0 * kDeg;
  rig.run(1.5);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
  EXPECT_NEAR(rig.plant.state().articulation, 8.0 * kDeg, 0.02 * kDeg);
  EXPECT_LT(rig.plant.state().speed, 5.0 - 1.8 * 1.4);
}

TEST_F(CanBridgeTest, StopWithoutFreshCommandsHoldsTheMeasuredArticulation) {
  rig.drive(5.0);
  rig.command.articulation_angle = 40.0 * kDeg;  // far away: the hinge is on its way
  rig.run(1.0);
  rig.arbiter_alive = false;
  rig.timeToStop();
  const double held = rig.plant.state().articulation;
  rig.run(1.5);
  EXPECT_NEAR(rig.plant.state().articulation, held, 0.8 * kDeg);
  EXPECT_EQ(rig.judge.last_info->source, static_cast<int>(supervision::Source::kHold));
  EXPECT_TRUE(rig.judge.last->steering_enable);
}

TEST_F(CanBridgeTest, AStopSteersAlongCommandsThatAreFreshAgain) {
  rig.drive(5.0);
  rig.arbiter_alive = false;
  rig.timeToStop();
  rig.run(0.1);
  rig.arbiter_alive = true;
  rig.command.articulation_angle = 8.0 * kDeg;
  rig.run(1.0);
  ASSERT_EQ(rig.state(), SafetyState::kStopping);
  EXPECT_NEAR(rig.judge.last->articulation_angle, 8.0 * kDeg, 0.01 * kDeg);
}

// The last set before it drives stems from a measurement that is too old once it is on the bus; the next
// one is fresh just until ACTIVE, and has become too old when the next set is due. The hinge was turned
// in between.
TEST(CanBridgeHold, IsOfTheAngleMeasuredThenNotOfOneBeforeItDrove) {
  Rig rig(0.001);
  double told = 2.0 * kDeg;
  rig.to_bridge = [&](const can::Frame& frame) {
    auto feedback = can::decode<can::TruckFeedbackFrame>(frame);
    if (!feedback) return std::optional<can::Frame>(frame);
    feedback->articulation_angle = told;
    feedback->speed = 1.0;  // so that the stop lasts
    return can::encode(*feedback);
  };
  rig.run(0.01);
  rig.jump(Stamp{});  // its sets are sent midway between the truck's frames
  rig.run(1.5);
  rig.arbiter_alive = false;
  Command said = rig.command;
  said.sequence = 1u << 20;
  const auto measured = [&](Stamp stamp) {
    said.stamp = stamp;
    rig.bridge->setCommand(said, rig.now);
  };
  rig.runToSet();
  rig.run(0.005);
  measured(rig.now - ms(60));
  ASSERT_TRUE(rig.bridge->engage(rig.now).accepted);
  rig.run(0.09);
  measured(rig.now + ms(5) - ms(299));
  rig.runToSet();
  ASSERT_EQ(rig.state(), SafetyState::kArmed);
  told = 10.0 * kDeg;
  measured(rig.now + ms(18) - ms(300));
  rig.run(0.005);
  ASSERT_TRUE(rig.state() == SafetyState::kActive || rig.state() == SafetyState::kDegraded);
  rig.runToSet();
  ASSERT_EQ(rig.state(), SafetyState::kStopping);
  rig.run(0.2);
  ASSERT_TRUE(rig.judge.last->steering_enable);
  EXPECT_NEAR(rig.judge.last->articulation_angle, 10.0 * kDeg, 0.01 * kDeg);
}

TEST_F(CanBridgeTest, StoppedIsLatchedUntilAnOperatorsReset) {
  rig.drive();
  rig.bridge->stop(rig.now);
  rig.run(10.0, [&] { return rig.state() == SafetyState::kStopped; });
  ASSERT_EQ(rig.state(), SafetyState::kStopped);
  EXPECT_EQ(rig.reason(), Reason::kOperatorStop);
  rig.run(30.0);
  EXPECT_EQ(rig.state(), SafetyState::kStopped);
  EXPECT_FALSE(rig.bridge->engage(rig.now).accepted);
  EXPECT_TRUE(rig.bridge->reset(rig.now).accepted);
  EXPECT_EQ(rig.state(), SafetyState::kStandby);
  rig.run(5.0);
  EXPECT_EQ(rig.state(), SafetyState::kStandby);
  EXPECT_TRUE(rig.bridge->engage(rig.now).accepted);
  rig.run(10.0, [&] { return rig.plant.state().speed > 2.9; });
  EXPECT_GT(rig.plant.state().speed, 2.9) << "drives again after reset and engage";
}

TEST_F(CanBridgeTest, ResetIsRefusedWhileStoppingAndUntilAllIsHealthyForOneSecond) {
  rig.drive();
  rig.arbiter_alive = false;
  rig.timeToStop();
  expectRefusal(rig.bridge->reset(rig.now), "still stopping");
  rig.run(10.0, [&] { return rig.state() == SafetyState::kStopped; });
  expectRefusal(rig.bridge->reset(rig.now), "command stale");
  rig.arbiter_alive = true;
  rig.run(0.9);
  expectRefusal(rig.bridge->reset(rig.now), "inputs not healthy for long enough");
  rig.run(0.2);
  EXPECT_TRUE(rig.bridge->reset(rig.now).accepted);
}

TEST_F(CanBridgeTest, ResetIsRefusedWhileTheTruckMoves) {
  rig.drive();
  rig.bridge->stop(rig.now);
  rig.run(10.0, [&] { return rig.state() == SafetyState::kStopped; });
  rig.run(1.0);
  rig.plant.reset(geometry::Pose(), 0.0, 1.0);  // pushed
  rig.run(0.05);
  expectRefusal(rig.bridge->reset(rig.now), "the truck moves");
  rig.run(5.0);
  EXPECT_TRUE(rig.bridge->reset(rig.now).accepted);
}

TEST_F(CanBridgeTest, ReleaseWhileDrivingBrakesToAStop) {
  rig.drive();
  EXPECT_TRUE(rig.bridge->release(rig.now).accepted);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
  EXPECT_EQ(rig.reason(), Reason::kOperatorRelease);
  rig.run(10.0);
  EXPECT_EQ(rig.state(), SafetyState::kStopped);
  EXPECT_EQ(rig.plant.state().speed, 0.0);
  EXPECT_FALSE(rig.bridge->release(rig.now).accepted);
}

TEST_F(CanBridgeTest, StopsWithinTheTimeThatTheDecelerationAllows) {
  rig.drive(5.0);
  rig.judge.stopAsked(rig.now);
  rig.bridge->stop(rig.now);
  const Stamp start = rig.now;
  rig.run(10.0, [&] { return rig.plant.state().speed < 0.01; });
  EXPECT_NEAR(toSeconds(rig.now - start), 5.0 / 2.2, 0.2);
}

// -------- random interleavings

// Any mixture of faults and requests: the judge finds no unsafe frame, and a stop stays a stop.
TEST(CanBridgeRandom, NoUnsafeFrameInRandomInterleavings) {
  constexpr int kRuns = 60;
  int stops = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::mt19937 random(static_cast<unsigned>(run));
    const auto dice = [&](int sides) {
      return static_cast<int>(random() % static_cast<unsigned>(sides));
    };
    Rig rig(0.001 * (1 + dice(20)));
    int corrupt = 0;
    rig.to_bridge = [&](can::Frame frame) {
      if (corrupt > 0 && dice(3) == 0) frame.data[static_cast<std::size_t>(dice(8))] ^= 0x10, --corrupt;
      return std::optional<can::Frame>(frame);
    };
    for (int i = 0; i < 60; ++i) {
      const SafetyState before = rig.state();
      rig.arbiter_alive = dice(12) != 0;
      rig.truck_alive = dice(12) != 0;
      rig.measurement_age = ms(dice(10) == 0 ? dice(400) : 60);
      rig.command.articulation_angle = (dice(80) - 40) * kDeg;
      rig.command.speed = dice(9);
      rig.command.stop = dice(25) == 0;
      rig.cab.brake = dice(40) == 0 ? 0.5 : 0.0;
      rig.cab.key = dice(30) == 0 ? can::OperatorKey::kManual : can::OperatorKey::kAutonomous;
      corrupt = dice(10) == 0 ? dice(6) : 0;
      const int edge = dice(8);
      if (edge == 0) rig.bridge->stop(rig.now), ++stops;
      if (edge == 1) rig.bridge->reset(rig.now);
      if (edge >= 2 && edge <= 5) rig.bridge->engage(rig.now);
      rig.pump();
      const bool must_stand = edge == 0 || (edge == 1 && before == SafetyState::kStopping);
      EXPECT_TRUE(!must_stand || isStop(rig.state()));
      rig.run(dice(4) == 0 ? 1.5 : 0.05 * dice(10));
    }
    for (const std::string& complaint : rig.judge.complaints)
      ADD_FAILURE() << "run " << run << ": " << complaint;
  }
  EXPECT_GT(stops, 100);
}

// RELIABILITY A2: after a stop request no frame but stop frames, the first within 20 ms, whatever
// happens.
TEST(CanBridgeRandom, EveryStopRequestIsOnTheBusWithinTwentyMilliseconds) {
  Stamp worst{};
  std::mt19937 random(42);
  Rig rig(0.02);
  rig.drive();
  for (int i = 0; i < 400; ++i) {
    rig.run(0.001 * (random() % 40));
    const Stamp asked = rig.now;
    const std::size_t before = rig.judge.times.size();
    rig.bridge->stop(rig.now);
    rig.pump();
    rig.run(0.04);
    ASSERT_GT(rig.judge.times.size(), before);
    EXPECT_TRUE(rig.judge.commands[before].stop);
    worst = std::max(worst, rig.judge.times[before] - asked);
    rig.run(5.0, [&] { return rig.state() == SafetyState::kStopped; });
    rig.run(0.02);
    ASSERT_TRUE(rig.bridge->reset(rig.now).accepted);
    rig.bridge->engage(rig.now);
    rig.run(0.15);
  }
  EXPECT_LE(worst, ms(20));
  std::printf("stop request to stop bit on the bus: worst %.1f ms\n", toSeconds(worst) * 1e3);
}

TEST(CanBridgeRandom, SameRunGivesTheSameBytesOnTheBus) {
  const auto once = [] {
    Rig rig;
    rig.drive();
    rig.command.articulation_angle = 0.1;
    rig.run(2.0);
    rig.arbiter_alive = false;
    rig.run(3.0);
    std::string bytes;
    for (const can::Frame& frame : rig.log) {
      bytes += std::to_string(frame.id);
      bytes.append(frame.data.begin(), frame.data.end());
    }
    return bytes;
  };
  const std::string first = once();
  EXPECT_GT(first.size(), 10000u);
  EXPECT_EQ(first, once());
}

}  // namespace
}  // namespace tunnel_pilot::bridge
