#include <gtest/gtest.h>

#include <cstdio>

#include "../can/fake_can_socket.h"
#include "rig.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/socket_can_bus.h"

// The bridge on SocketCAN whose kernel fails in the ways that real ones were seen to: it stops within
// 60 ms of the fault, sends nothing late, comes back by itself as far as STANDBY or STOPPED and no
// further.
namespace tunnel_pilot::bridge {
namespace {

using supervision::Reason;

std::vector<can::Identifier> allIdentifiers() {
  std::vector<can::Identifier> identifiers;
  for (const can::FrameLayout& layout : can::frameLayouts()) identifiers.push_back({layout.id, false});
  return identifiers;
}

class SocketCanBridge : public testing::TestWithParam<double> {
 protected:
  SocketCanBridge()
      : rig(GetParam(), [this](can::Bus& wire) -> std::unique_ptr<can::Bus> {
          kernel.wire = &wire;
          return std::make_unique<can::SocketCanBus>("can0", allIdentifiers(),
                                                     std::make_unique<can::FakeCanSocket>(kernel));
        }) {}

  void TearDown() override {
    for (const std::string& complaint : rig.judge.complaints) {
      if (complaint.find("counter step") == std::string::npos) ADD_FAILURE() << complaint;
    }
  }

  /// Expects STOPPING for a fault of the bus at most 60 ms from now.
  void expectStop() {
    const double time = rig.timeToStop();
    EXPECT_EQ(rig.reason(), Reason::kBusFault) << supervision::toString(rig.reason());
    EXPECT_LE(time, 0.0601);
    std::printf("  tick %2.0f ms: %5.1f ms\n", 1e3 * GetParam(), 1e3 * time);
  }

  /// Expects that frames are confirmed again within 250 ms, that none of them is of the past, and that
  /// the bridge drives again only when it is told to.
  void expectRecovery(std::size_t sent_before) {
    const std::uint64_t confirmed = rig.bridge_bus->confirmed();
    const Stamp back = rig.now;
    rig.run(0.25, [&] { return rig.bridge_bus->confirmed() > confirmed; });
    EXPECT_LE(rig.now - back, ms(250));
    EXPECT_GT(rig.bridge_bus->confirmed(), confirmed);
    for (std::size_t i = sent_before; i < kernel.sent.size(); ++i) {
      const auto command = can::decode<can::TruckCommandFrame>(kernel.sent[i]);
      EXPECT_TRUE(!command || command->stop) << "frame " << i << " was made before the stop";
    }
    rig.run(20.0);
    EXPECT_EQ(rig.state(), SafetyState::kStopped);
    EXPECT_TRUE(rig.bridge->reset(rig.now).accepted);
    rig.run(3.0);
    EXPECT_EQ(rig.state(), SafetyState::kStandby) << "never armed by itself";
  }

  /// Frames that the kernel holds and nothing of which may ever be sent.
  std::size_t waiting() const { return kernel.queue.size(); }

  can::FakeKernel kernel;
  Rig rig;
};
INSTANTIATE_TEST_SUITE_P(Ticks, SocketCanBridge, testing::Values(0.001, 0.005, 0.020));

TEST_P(SocketCanBridge, DrivesOnAHealthyBusWithoutAWordOfTrouble) {
  rig.drive();
  rig.run(10.0);
  EXPECT_EQ(rig.state(), SafetyState::kActive);
  EXPECT_EQ(kernel.cycles, 0);
}

TEST_P(SocketCanBridge, AControllerThatHangsInAnyPhaseStopsAndItsQueueIsEmptied) {
  for (int phase = 0; phase < 20; ++phase) {
    can::FakeKernel other;
    Rig r(GetParam(), [&](can::Bus& wire) -> std::unique_ptr<can::Bus> {
      other.wire = &wire;
      return std::make_unique<can::SocketCanBus>("can0", allIdentifiers(),
                                                 std::make_unique<can::FakeCanSocket>(other));
    });
    r.drive();
    r.run(0.001 * phase);
    other.stall();
    other.helper_fails = "stays as it is";
    EXPECT_LE(r.timeToStop(), 0.0601) << "phase " << phase << " ms";
    EXPECT_EQ(r.reason(), Reason::kBusFault);
    r.run(2.0);
    EXPECT_LE(other.queue.size(), 3 * TransmitWatch::kMaxSets) << "no more can ever come late";
  }
}

TEST_P(SocketCanBridge, AStalledQueueIsFlushedNotSent) {
  rig.drive();
  kernel.stall();
  const std::size_t sent = kernel.sent.size();
  expectStop();
  EXPECT_GT(waiting(), 0u);
  rig.run(2.0, [&] { return rig.bridge_bus->state() == can::BusState::kActive; });
  EXPECT_EQ(kernel.cycles, 1);
  expectRecovery(sent);
}

TEST_P(SocketCanBridge, WithoutAHelperAStallIsAStopUntilAnOperatorCyclesTheLink) {
  kernel.helper_fails = "it is not installed";
  rig.drive();
  kernel.stall();
  expectStop();
  rig.run(20.0);
  EXPECT_EQ(rig.state(), SafetyState::kStopped);
  const auto answer = rig.bridge->reset(rig.now);
  EXPECT_FALSE(answer.accepted);
  EXPECT_NE(answer.reason.find("ip link set can0 down; ip link set can0 up"), std::string::npos)
      << answer.reason;
  const int writes = kernel.writes;
  rig.run(5.0);
  EXPECT_EQ(kernel.writes, writes) << "nothing is written into a stalled queue";
  const std::size_t sent = kernel.sent.size();
  kernel.down();
  kernel.up();
  expectRecovery(sent);
}

TEST_P(SocketCanBridge, BusOffStopsAtOnceAndIsCycled) {
  rig.drive();
  const std::size_t sent = kernel.sent.size();
  kernel.busOff();
  expectStop();
  rig.run(2.0, [&] { return rig.bridge_bus->state() == can::BusState::kActive; });
  expectRecovery(sent);
}

TEST_P(SocketCanBridge, ABusOffOfWhichNoErrorFrameTellsIsFoundByItsEchoes) {
  rig.drive();
  kernel.busOff();
  kernel.inbox.clear();
  expectStop();
}

TEST_P(SocketCanBridge, ABusThatGoesOffAgainAndAgainIsNotHurried) {
  rig.drive();
  kernel.broken = true;
  kernel.busOff();
  expectStop();
  rig.run(10.0);
  EXPECT_LE(kernel.cycles, 21) << "twice a second";
  EXPECT_GE(kernel.cycles, 10) << "but never given up";
}

TEST_P(SocketCanBridge, AStallOfABusThatHasJustWorkedAgainIsFlushedAtOnce) {
  rig.drive();
  kernel.stall();
  expectStop();
  const std::uint64_t confirmed = rig.bridge_bus->confirmed();
  rig.run(0.25, [&] { return rig.bridge_bus->confirmed() > confirmed; });
  ASSERT_EQ(kernel.cycles, 1);
  kernel.stall();
  rig.run(0.06, [&] { return kernel.cycles == 2; });
  EXPECT_EQ(kernel.cycles, 2) << "its frames would wait for as long as the helper is not asked";
}

TEST_P(SocketCanBridge, ATimeoutOfTheTransmitterWithNothingInFlightStopsAndIsCycled) {
  rig.drive();
  rig.run(0.1, [&] { return rig.bridge_bus->inFlight() == 0; });
  const std::size_t sent = kernel.sent.size();
  kernel.told(CAN_ERR_TX_TIMEOUT);
  expectStop();
  rig.run(2.0, [&] { return rig.bridge_bus->state() == can::BusState::kActive; });
  expectRecovery(sent);
}

TEST_P(SocketCanBridge, LinkDownStopsAndUpIsBack) {
  rig.drive();
  kernel.down();
  expectStop();
  rig.run(1.0);
  const std::size_t sent = kernel.sent.size();
  kernel.up();
  expectRecovery(sent);
}

TEST_P(SocketCanBridge, UnpluggedStopsAndPluggedIsBack) {
  rig.drive();
  kernel.unplug();
  expectStop();
  rig.run(1.0);
  kernel.plug();
  rig.run(1.0);
  const std::size_t sent = kernel.sent.size();
  kernel.configure();
  expectRecovery(sent);
}

TEST_P(SocketCanBridge, AForeignSenderOfOurIdentifierStopsAndOurEchoesDoNot) {
  rig.drive();
  kernel.hear(*can::encode(can::TruckCommandFrame()));
  expectStop();
}

TEST_P(SocketCanBridge, AProcessHeldUpLongerThanAnEchoMayTakeReadsItsEchoesFirst) {
  rig.drive();
  rig.tick_period = 0.045;  // from the next tick on
  rig.run(0.2);
  EXPECT_EQ(rig.state(), SafetyState::kActive) << supervision::toString(rig.reason());
  EXPECT_EQ(kernel.cycles, 0);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
