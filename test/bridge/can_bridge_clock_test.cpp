#include <gtest/gtest.h>

#include "holding_bus.h"

// What a clock that jumps makes void. That it stops, and how fast: can_bridge_watch_test.cpp.
namespace tunnel_pilot::bridge {
namespace {

// The bridge's clock jumps, back or ahead, by this time [s].
class ClockJump : public HoldingBusTest, public testing::WithParamInterface<double> {
 protected:
  ClockJump() : HoldingBusTest(0.005) {}
  void jump() { rig.jump(fromSeconds(GetParam())); }
};
INSTANTIATE_TEST_SUITE_P(BackAndAhead, ClockJump, testing::Values(-5.0, 100.0));

TEST_P(ClockJump, ASetIsSentWithinTheCall) {
  rig.run(1.5);
  rig.runToSet();  // so that none is due
  const std::size_t before = rig.judge.commands.size();
  jump();
  EXPECT_EQ(rig.judge.commands.size(), before + 1);
}

TEST_P(ClockJump, TheCommandBeforeItIsStale) {
  rig.run(1.5);
  rig.arbiter_alive = false;
  jump();
  rig.run(0.06);
  EXPECT_EQ(rig.bridge->engage(rig.clock()).reason, "starting up: command stale");
}

TEST(CanBridgeClock, TheCommandBeforeAClockThatBeginsAtZeroAnewIsStale) {
  Rig rig;
  rig.run(1.5);
  rig.arbiter_alive = false;
  rig.jump(-rig.now);
  rig.run(0.06);
  EXPECT_EQ(rig.bridge->engage(rig.clock()).reason, "starting up: command stale");
}

TEST_P(ClockJump, NoWayIsReckonedAcrossIt) {
  rig.drive(3.0);
  const double before = rig.bridge->motion().pose.x;
  jump();
  rig.run(0.1);
  EXPECT_NEAR(rig.bridge->motion().pose.x, before, 0.35);
}

TEST_P(ClockJump, FramesInFlightAreAsYoungAsTheJump) {
  rig.run(1.5);
  bus->hold();
  rig.runToSet();
  jump();
  rig.run(0.03);
  EXPECT_EQ(bus->discards(), 0);
  rig.run(0.01);
  EXPECT_EQ(bus->discards(), 1);
}

TEST_P(ClockJump, ABusThatIsOffIsAskedToDiscardAnew) {
  rig.run(1.5);
  rig.bridge_side.setState(can::BusState::kBusOff);
  rig.run(0.1);
  ASSERT_EQ(bus->discards(), 1);
  jump();
  rig.run(0.005);
  EXPECT_EQ(bus->discards(), 2);
}

TEST_P(ClockJump, AStopGoesOnUntilTheTruckStands) {
  rig.drive(3.0);
  rig.bridge->stop(rig.now);
  rig.run(0.1);
  jump();
  rig.run(0.1);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
}

// With two sets in flight the jump sends none, and the bridge takes it that the truck steers on.
TEST_P(ClockJump, WhereTheSteeringShouldBeIsReckonedAnew) {
  rig.drive(3.0);
  rig.command.articulation_angle = 0.5;
  rig.run(0.6);
  rig.runToSet();
  bus->hold();
  rig.runToSet();
  rig.runToSet();
  jump();
  bus->prove();
  rig.runToTick();
  EXPECT_EQ(rig.bridge->status().tracking_error, 0.0);
}

TEST(CanBridgeClock, TwoTicksAtOneTimeAreNoJump) {
  Rig rig;
  rig.drive();
  rig.bridge->tick(rig.now);
  rig.bridge->tick(rig.now);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
}

// -------- after which the next tick, of 25 ms, has the truck's frames and a command already

TEST(CanBridgeClock, AfterAJumpTheLinkProvesItsHealthAnewThoughTheNextTickHasAllFrames) {
  Rig rig(0.025);
  rig.run(1.5);
  ASSERT_EQ(rig.state(), SafetyState::kStandby);
  rig.bridge->clockJumped(rig.now);
  rig.run(0.9);
  EXPECT_EQ(rig.state(), SafetyState::kInit);
}

TEST(CanBridgeClock, AfterAJumpAllInputsProveTheirHealthAnewThoughTheNextTickHasThem) {
  Rig rig(0.025);
  rig.run(1.5);
  rig.bridge->stop(rig.now);
  rig.run(2.0);
  ASSERT_EQ(rig.state(), SafetyState::kStopped);
  rig.runToTick();
  rig.jump(ms(1));
  rig.runToTick();
  EXPECT_EQ(rig.bridge->reset(rig.clock()).reason, "inputs not healthy for long enough");
}

TEST(CanBridgeClock, AfterAJumpTheTruckProvesAnewThatItStandsThoughTheNextTickHasAllFrames) {
  Rig rig(0.025);
  rig.drive(1.0);
  rig.bridge->stop(rig.now);
  rig.run(5.0, [&] { return rig.plant.state().speed < 0.01; });
  rig.run(0.1);
  rig.runToTick();
  ASSERT_EQ(rig.state(), SafetyState::kStopping);
  rig.jump(fromSeconds(100.0));
  rig.run(0.45);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
  rig.run(0.1);
  EXPECT_EQ(rig.state(), SafetyState::kStopped);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
