#include <gtest/gtest.h>

#include <algorithm>

#include "../can/fake_can_socket.h"
#include "rig.h"
#include "tunnel_pilot/can/socket_can_bus.h"

// The bridge and the truck's controller on a J1939 network: the claim before all else, and what stops.
namespace tunnel_pilot::bridge {
namespace {

using supervision::Reason;
using TruckState = simulation::TruckController::State;

constexpr std::uint8_t kPilot = 128, kTruck = 129, kStranger = 0x27;

can::Frame frameOf(std::uint32_t pgn, std::uint8_t source) {
  can::Frame frame;
  frame.id = can::toIdentifier({3, pgn, can::kGlobalAddress, source});
  frame.extended = true;
  frame.length = 8;
  return frame;
}

can::Frame claimOf(std::uint64_t name) {
  can::Frame frame = frameOf(can::kAddressClaimedPgn, kPilot);
  for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(name >> 8 * i);
  return frame;
}

bool isPilots(const can::Frame& frame) {
  const std::uint32_t pgn = can::fromIdentifier(frame.id).pgn;
  return pgn >= 0xFF10 && pgn <= 0xFF12;
}

class J1939Bridge : public testing::TestWithParam<double> {
 protected:
  J1939Bridge() : rig(GetParam(), can::ProfileKind::kJ1939) {}

  void TearDown() override {
    for (const std::string& complaint : rig.judge.complaints) ADD_FAILURE() << complaint;
    for (const can::Frame& frame : rig.log) ASSERT_TRUE(frame.extended) << std::hex << frame.id;
  }

  std::uint64_t ownName() const { return Rig::bridgeParameters().can.j1939.name; }

  /// How many frames of the pilot's groups have left it.
  std::ptrdiff_t pilotFrames() const { return std::count_if(rig.log.begin(), rig.log.end(), isPilots); }

  Rig rig;
};
INSTANTIATE_TEST_SUITE_P(Ticks, J1939Bridge, testing::Values(0.001, 0.005, 0.020));

TEST_P(J1939Bridge, SendsNoCommandBeforeTheAddressIsClaimed) {
  const Stamp start = rig.now;
  rig.run(1.0, [&] { return pilotFrames() > 0; });
  EXPECT_GE(rig.now - start, ms(250));
  EXPECT_LE(rig.now - start, ms(300));
  const auto first = std::find_if(rig.log.begin(), rig.log.end(), [](const can::Frame& frame) {
    return can::fromIdentifier(frame.id).source == kPilot;
  });
  EXPECT_EQ(can::fromIdentifier(first->id).pgn, can::kAddressClaimedPgn);
}

TEST_P(J1939Bridge, IsNotEngagedWhileItClaims) {
  rig.run(0.2);
  const CanBridge::Answer answer = rig.bridge->engage(rig.now);
  EXPECT_FALSE(answer.accepted);
  EXPECT_EQ(answer.reason, "starting up: bus fault");
}

TEST_P(J1939Bridge, EngagesDrivesAndStops) {
  rig.drive(3.0);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
  EXPECT_EQ(rig.controller->state(), TruckState::kObeying);
  rig.run(10.0);
  EXPECT_GT(rig.plant.state().pose.x, 20.0);
  EXPECT_EQ(rig.bridge->status().frames_rejected, 0u);
  rig.bridge->stop(rig.now);
  rig.judge.stopAsked(rig.now);
  rig.run(10.0);
  EXPECT_EQ(rig.state(), SafetyState::kStopped);
  EXPECT_LT(std::abs(rig.plant.state().speed), 0.05);
  EXPECT_TRUE(rig.bridge->reset(rig.now).accepted);
}

TEST_P(J1939Bridge, AForeignSenderOfOurGroupStops) {
  for (const std::uint8_t source : {kPilot, kStranger}) {
    Rig other(GetParam(), can::ProfileKind::kJ1939);
    other.drive();
    other.wire_to_bridge->send(frameOf(0xFF10, source));
    EXPECT_LE(other.timeToStop(), GetParam() + 1e-9);
    EXPECT_EQ(other.reason(), Reason::kBusFault);
  }
}

TEST_P(J1939Bridge, AnotherUserOfOurAddressStops) {
  rig.drive();
  rig.wire_to_bridge->send(frameOf(0xFEF1, kPilot));
  EXPECT_LE(rig.timeToStop(), GetParam() + 1e-9);
  EXPECT_EQ(rig.reason(), Reason::kBusFault);
}

TEST_P(J1939Bridge, TheTrucksFramesFromAnotherAddressAreNotTheTrucks) {
  rig.drive();
  rig.to_bridge = [](can::Frame frame) {
    frame.id = (frame.id & ~0xFFu) | kStranger;
    return std::optional<can::Frame>(frame);
  };
  EXPECT_LE(rig.timeToStop(), 0.062 + GetParam());
  EXPECT_EQ(rig.reason(), Reason::kFeedbackStale);
}

TEST_P(J1939Bridge, StrangersFramesAreDiscardedAndCounted) {
  rig.drive();
  const std::uint32_t before = rig.bridge->status().frames_rejected;
  for (unsigned i = 0; i < 200; ++i) {
    can::Frame frame = frameOf(i % 2 == 0 ? 0xFF20 : 0xFE00 + i, kStranger);
    if (i % 3 == 0) {  // frames of the plain profile are strangers here
      frame.id = can::kTruckFeedbackId;
      frame.extended = false;
    }
    rig.wire_to_bridge->send(frame);
    if (i % 8 == 7) rig.run(0.02);
  }
  rig.run(0.05);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
  EXPECT_EQ(rig.bridge->status().frames_rejected, before + 200);
}

TEST_P(J1939Bridge, CommandsFromAnotherAddressAreNotObeyed) {
  rig.to_truck = [](can::Frame frame) {
    frame.id = (frame.id & ~0xFFu) | kStranger;
    return std::optional<can::Frame>(frame);
  };
  rig.run(1.5);
  rig.bridge->engage(rig.now);
  rig.run(1.0);
  EXPECT_EQ(rig.controller->state(), TruckState::kReady);
  EXPECT_EQ(rig.controller->framesAccepted(), 0u);
}

TEST_P(J1939Bridge, AHigherNameThatClaimsOurAddressChangesNothing) {
  rig.drive();
  rig.wire_to_bridge->send(claimOf(ownName() + 1));
  rig.run(1.0);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
}

TEST_P(J1939Bridge, TheAddressLostWhileActiveStopsAndSilencesWithin250Milliseconds) {
  rig.drive();
  rig.wire_to_bridge->send(claimOf(ownName() - 1));
  EXPECT_LE(rig.timeToStop(), GetParam() + 1e-9);
  EXPECT_EQ(rig.reason(), Reason::kBusFault);
  const std::ptrdiff_t last = pilotFrames();
  rig.run(0.13);
  EXPECT_EQ(rig.controller->state(), TruckState::kFailed) << "the truck stops by its own limit";
  rig.run(20.0);
  EXPECT_EQ(pilotFrames(), last);
  EXPECT_EQ(rig.state(), SafetyState::kStopped);
  EXPECT_LT(std::abs(rig.plant.state().speed), 0.05);
}

TEST_P(J1939Bridge, NoFrameFollowsTheLossInAnyPhase) {
  for (int phase = 0; phase < 20; ++phase) {
    Rig other(GetParam(), can::ProfileKind::kJ1939);
    other.drive();
    other.run(1e-3 * phase);
    other.wire_to_bridge->send(claimOf(ownName() - 1));
    const auto before = static_cast<std::ptrdiff_t>(other.log.size());
    other.run(0.5);
    EXPECT_EQ(std::count_if(other.log.begin() + before, other.log.end(), isPilots), 0) << phase;
  }
}

TEST_P(J1939Bridge, TheAddressLostIsToldInWordsWhereTheResetIsRefused) {
  rig.drive();
  rig.wire_to_bridge->send(claimOf(ownName() - 1));
  rig.run(20.0);
  const CanBridge::Answer answer = rig.bridge->reset(rig.now);
  EXPECT_FALSE(answer.accepted);
  EXPECT_EQ(answer.reason.rfind("bus fault: J1939 address 128 is lost to NAME 0x", 0), 0u)
      << answer.reason;
}

TEST_P(J1939Bridge, ARestartAfterALossClaimsAnewAndDrivesOnAnOperatorsEdges) {
  rig.drive();
  rig.wire_to_bridge->send(claimOf(ownName() - 1));
  rig.run(20.0);
  const auto parameters = Rig::bridgeParameters();
  rig.bridge_end =
      can::withProfile({can::ProfileKind::kJ1939, parameters.can.j1939}, rig.bridge_side.connect());
  rig.bridge = std::make_unique<CanBridge>(parameters, Rig::truckParameters().geometry, *rig.bridge_end);
  rig.judge = Judge();  // a new process counts anew
  rig.run(2.0);
  EXPECT_EQ(rig.state(), SafetyState::kStandby);
  rig.drive();
  EXPECT_EQ(rig.state(), SafetyState::kActive);
}

TEST_P(J1939Bridge, AfterTheBusWasDownTheAddressIsClaimedBeforeFramesGoOn) {
  rig.drive();
  rig.bridge_side.setState(can::BusState::kDown);
  rig.run(0.1);
  EXPECT_EQ(rig.state(), SafetyState::kStopping);
  const std::ptrdiff_t before = pilotFrames();
  rig.bridge_side.setState(can::BusState::kActive);
  rig.run(0.25);
  EXPECT_EQ(pilotFrames(), before);
  rig.run(0.1);
  EXPECT_GT(pilotFrames(), before);
  rig.judge = Judge();  // it counted on while the bus was down
}

TEST_P(J1939Bridge, AfterTheClaimTheAngleOfAStopBeginsAtTheMeasuredOne) {
  rig.drive();
  rig.command.articulation_angle = 0.5;
  rig.run(0.6);  // turning
  rig.bridge_side.setState(can::BusState::kDown);
  rig.run(0.05);
  rig.bridge_side.setState(can::BusState::kActive);
  rig.judge = Judge();
  rig.run(0.5, [&] { return !rig.judge.commands.empty(); });
  ASSERT_TRUE(rig.judge.last->steering_enable);
  EXPECT_NEAR(rig.judge.last->articulation_angle, rig.plant.state().articulation, 0.015);
}

// -------- on SocketCAN, with a kernel that fails

class J1939SocketCanBridge : public testing::TestWithParam<double> {
 protected:
  J1939SocketCanBridge()
      : rig(GetParam(), [this](can::Bus& wire) -> std::unique_ptr<can::Bus> {
          kernel.wire = &wire;
          const can::Profile profile{can::ProfileKind::kJ1939, Rig::bridgeParameters().can.j1939};
          return can::withProfile(profile, std::make_unique<can::SocketCanBus>(
                                               "can0", can::identifiersOf(profile),
                                               std::make_unique<can::FakeCanSocket>(kernel)));
        }) {
    // The wire of this rig is the plain one: the truck's words are translated on it.
    rig.to_bridge = [](can::Frame frame) {
      for (const can::J1939Group& group : can::j1939Groups()) {
        if (group.id == frame.id)
          frame.id = can::toIdentifier({3, group.pgn, can::kGlobalAddress, kTruck});
      }
      frame.extended = true;
      return std::optional<can::Frame>(frame);
    };
    rig.to_truck = [](can::Frame frame) {
      for (const can::J1939Group& group : can::j1939Groups()) {
        if (group.pgn != can::fromIdentifier(frame.id).pgn) continue;
        frame.id = group.id;
        frame.extended = false;
      }
      return std::optional<can::Frame>(frame);
    };
  }
  can::FakeKernel kernel;
  Rig rig;
};
INSTANTIATE_TEST_SUITE_P(Ticks, J1939SocketCanBridge, testing::Values(0.005, 0.020));

TEST_P(J1939SocketCanBridge, DrivesWithoutAWordOfTrouble) {
  rig.drive();
  rig.run(5.0);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
  EXPECT_EQ(rig.bridge_bus->trouble(), "");
  EXPECT_EQ(kernel.cycles, 0);
}

TEST_P(J1939SocketCanBridge, AStalledQueueStopsWithin60MillisecondsAndIsClaimedAnewAfterTheCycle) {
  rig.drive();
  kernel.stall();
  EXPECT_LE(rig.timeToStop(), 0.0601);
  EXPECT_EQ(rig.reason(), Reason::kBusFault);
  rig.run(1.5);
  EXPECT_GE(kernel.cycles, 1);
  EXPECT_EQ(rig.bridge_bus->state(), can::BusState::kActive);
  EXPECT_EQ(rig.bridge_bus->trouble(), "");
}

TEST_P(J1939SocketCanBridge, RequestsForClaimsWhileDrivingDoNotLookLikeAStall) {
  rig.drive();
  for (int i = 0; i < 200; ++i) {
    can::Frame request;
    request.id = can::toIdentifier({6, can::kRequestPgn, can::kGlobalAddress, kStranger});
    request.extended = true;
    request.length = 3;
    request.data = {0x00, 0xEE, 0x00};
    kernel.hear(request);
    rig.run(0.01);
  }
  EXPECT_EQ(rig.state(), SafetyState::kActive);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
