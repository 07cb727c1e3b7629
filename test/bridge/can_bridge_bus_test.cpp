#include <gtest/gtest.h>

#include "holding_bus.h"

// What the bridge asks of a bus that does not work, and what of one that does not prove its frames.
namespace tunnel_pilot::bridge {
namespace {

using supervision::Command;

class CanBridgeBus : public HoldingBusTest {
 protected:
  CanBridgeBus() : HoldingBusTest(0.001) {}
};

TEST_F(CanBridgeBus, ABusThatStaysOffIsAskedToDiscardOnceIn500Milliseconds) {
  rig.run(0.1);
  rig.bridge_side.setState(can::BusState::kBusOff);
  rig.run(0.001);
  EXPECT_EQ(bus->discards(), 1);
  rig.run(0.499);
  EXPECT_EQ(bus->discards(), 1);
  rig.run(0.001);
  EXPECT_EQ(bus->discards(), 2);
}

TEST_F(CanBridgeBus, WithTwoSetsInFlightNotEvenAStopIsWritten) {
  rig.drive();
  rig.runToSet();
  bus->hold();
  rig.runToSet();
  rig.runToSet();
  const std::size_t before = rig.judge.commands.size();
  rig.bridge->stop(rig.now);
  rig.run(0.01);
  EXPECT_EQ(rig.judge.commands.size(), before);
  bus->prove();
  rig.run(0.001);
  EXPECT_TRUE(rig.judge.last->stop);
}

// The angle that went out counts, not the measured one, to which it would jump.
TEST_F(CanBridgeBus, OfSetsOfWhichTheBusTakesTheCommandAloneTheAngleGoesOn) {
  rig.drive();
  rig.valve_stuck = true;
  rig.command.articulation_angle = 0.1;
  rig.runToSet();
  bus->takeCommandsOnly(true);
  const double before = rig.judge.last->articulation_angle;
  for (int set = 0; set < 8; ++set) {
    rig.runToSet();
    EXPECT_GT(rig.judge.last->articulation_angle, before) << set;
  }
  bus->takeCommandsOnly(false);
  rig.run(0.1);
}

// After a while without sets, stops that come and go are told at once again, up to the bound of 16 sets.
TEST_F(CanBridgeBus, TheTimeThatSetsAreInFlightCountsForTheBoundOnTheRate) {
  rig.run(1.5);
  rig.arbiter_alive = false;
  bus->hold();
  rig.run(0.3);
  bus->prove();
  Command said = rig.command;
  said.sequence = 1u << 20;
  for (int pair = 0; pair < 7; ++pair) {
    said.stop = false;
    said.stamp = rig.now;
    rig.bridge->setCommand(said, rig.now);
    rig.runToSet();
    said.stop = true;
    rig.bridge->setCommand(said, rig.now);
    rig.pump();
    EXPECT_TRUE(rig.judge.last->stop) << pair;
  }
}

}  // namespace
}  // namespace tunnel_pilot::bridge
