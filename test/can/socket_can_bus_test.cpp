#include "tunnel_pilot/can/socket_can_bus.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "fake_can_socket.h"

// The bus on a kernel that does what real ones were seen to do.
namespace tunnel_pilot::can {
namespace {

constexpr std::uint32_t kOwn = 0x110;
constexpr std::uint32_t kTruck = 0x120;
constexpr std::uint32_t kExtended = 0x18EF0102;

Frame makeFrame(std::uint32_t id, bool extended = false) {
  Frame frame;
  frame.id = id;
  frame.extended = extended;
  frame.length = 8;
  return frame;
}

class SocketCanBusTest : public testing::Test {
 protected:
  SocketCanBus& bus() {
    if (!bus_) {
      bus_ = std::make_unique<SocketCanBus>(
          "can0", std::vector<Identifier>{{kTruck, false}, {kOwn, false}, {kExtended, true}},
          std::make_unique<FakeCanSocket>(kernel));
    }
    return *bus_;
  }
  /// Reads until nothing waits; returns how many frames came.
  int read() {
    int count = 0;
    while (bus().receive()) ++count;
    return count;
  }
  void expectTrouble(const std::string& words) {
    EXPECT_NE(bus().trouble().find(words), std::string::npos) << bus().trouble();
  }
  FakeKernel kernel;
  std::unique_ptr<SocketCanBus> bus_;
};

TEST_F(SocketCanBusTest, CountsAFrameAsSentWhenItsEchoCameAndGivesItToNobody) {
  ASSERT_TRUE(bus().send(makeFrame(kOwn)));
  EXPECT_EQ(bus().inFlight(), 1u);
  EXPECT_EQ(bus().confirmed(), 0u);
  EXPECT_EQ(read(), 0);
  EXPECT_EQ(bus().inFlight(), 0u);
  EXPECT_EQ(bus().confirmed(), 1u);
  EXPECT_EQ(bus().late(), 0u);
}

TEST_F(SocketCanBusTest, GivesAForeignFrameOfAnOwnIdentifier) {
  bus().send(makeFrame(kOwn));
  kernel.hear(makeFrame(kOwn));
  EXPECT_EQ(read(), 1) << "the foreign one, not the echo";
}

TEST_F(SocketCanBusTest, LetsThroughTheListAloneWhateverTheKernelGives) {
  bus();
  for (std::uint32_t id = 0; id < 0x800; ++id) kernel.hear(makeFrame(id));
  for (std::uint32_t id = 0; id < 0x1000; ++id) kernel.hear(makeFrame(id, true));
  kernel.hear(makeFrame(kExtended, true));
  kernel.inbox.push_back({Received::Kind::kOther, Frame(), 0});
  EXPECT_EQ(read(), 3);
  EXPECT_EQ(bus().discarded(), 0x800u - 2 + 0x1000 + 1);
  EXPECT_EQ(kernel.listen.size(), 3u) << "the kernel was asked for the same";
}

TEST_F(SocketCanBusTest, RefusesAFrameForAFullQueueOfOthersAndGoesOn) {
  bus();
  kernel.stall();
  kernel.queue.resize(FakeKernel::kQueueLength);
  EXPECT_FALSE(bus().send(makeFrame(kOwn)));
  EXPECT_EQ(bus().state(), BusState::kActive);
  kernel.release();
  EXPECT_TRUE(bus().send(makeFrame(kOwn)));
}

TEST_F(SocketCanBusTest, StopsWritingWhenTheQueueIsFullOfItsOwn) {
  bus();
  kernel.stall();
  while (bus().send(makeFrame(kOwn))) {
  }
  EXPECT_EQ(bus().inFlight(), FakeKernel::kQueueLength);
  EXPECT_EQ(bus().state(), BusState::kDown);
  const int writes = kernel.writes;
  EXPECT_FALSE(bus().send(makeFrame(kOwn)));
  EXPECT_EQ(kernel.writes, writes);
  expectTrouble("stuck in the queue of can0");
}

TEST_F(SocketCanBusTest, DiscardingCyclesTheLinkOnceAndLeavesNothingBehind) {
  bus();
  kernel.stall();
  for (int i = 0; i < 3; ++i) bus().send(makeFrame(kOwn));
  bus().discard();
  bus().discard();
  EXPECT_EQ(bus().state(), BusState::kDown);
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(kernel.cycles, 1);
  EXPECT_EQ(bus().state(), BusState::kActive);
  EXPECT_EQ(bus().inFlight(), 0u);
  EXPECT_TRUE(kernel.sent.empty()) << "nothing of what waited";
  EXPECT_TRUE(bus().send(makeFrame(kOwn)));
  read();
  EXPECT_EQ(bus().late(), 0u);
}

TEST_F(SocketCanBusTest, DiscardingDoesNothingWhereNothingWaits) {
  bus().discard();
  EXPECT_EQ(kernel.cycles, 0);
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, WithoutTheHelperItStaysDownSaysSoAndAnOperatorCanCycle) {
  kernel.helper_fails = "it is not installed";
  bus();
  kernel.stall();
  bus().send(makeFrame(kOwn));
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  expectTrouble("it is not installed");
  expectTrouble("ip link set can0 down; ip link set can0 up");
  kernel.release();  // the burst comes after all, and does not make it trust the bus again
  read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  EXPECT_EQ(bus().late(), 1u);
  EXPECT_FALSE(bus().send(makeFrame(kOwn)));
  kernel.down();
  kernel.up();
  read();
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
  EXPECT_EQ(bus().trouble(), "");
}

TEST_F(SocketCanBusTest, AHelperThatCannotBeStartedIsToldAtOnce) {
  kernel.helper_missing = "it is not installed";
  bus();
  kernel.stall();
  bus().send(makeFrame(kOwn));
  bus().discard();
  expectTrouble("can_link_cycle failed (it is not installed)");
}

TEST_F(SocketCanBusTest, BusOffStaysUntilTheLinkWasDown) {
  bus();
  kernel.busOff();
  read();
  EXPECT_EQ(bus().state(), BusState::kBusOff);
  EXPECT_FALSE(bus().send(makeFrame(kOwn))) << "the kernel would take it and call it a success";
  kernel.told(CAN_ERR_RESTARTED);
  read();
  EXPECT_EQ(bus().state(), BusState::kBusOff) << "a restart sends what waited";
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, SaysThatItIsBusOffAndWhyItStaysSo) {
  kernel.helper_fails = "exit status 1";
  bus();
  kernel.busOff();
  read();
  EXPECT_EQ(bus().trouble(), "can0 is bus-off");
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  expectTrouble("can0 is bus-off, can_link_cycle failed (exit status 1)");
}

TEST_F(SocketCanBusTest, FindsABusThatWasOffBeforeItStarted) {
  kernel.busOff();
  kernel.inbox.clear();  // the error frame came before
  read();
  EXPECT_EQ(bus().state(), BusState::kBusOff);
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, ALostCarrierIsBusOff) {
  bus();
  kernel.link.carrier = false;
  kernel.changes.push_back(kernel.link);
  read();
  EXPECT_EQ(bus().state(), BusState::kBusOff);
}

TEST_F(SocketCanBusTest, TellsWarningPassiveAndActiveAgain) {
  bus();
  kernel.told(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING);
  read();
  EXPECT_EQ(bus().state(), BusState::kWarning);
  kernel.told(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE);
  read();
  EXPECT_EQ(bus().state(), BusState::kPassive);
  kernel.told(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW);  // of no state at all
  read();
  EXPECT_EQ(bus().state(), BusState::kPassive);
  kernel.told(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE);
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, ATimeoutOfTheTransmitterStopsWriting) {
  bus();
  kernel.told(CAN_ERR_TX_TIMEOUT);
  read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, DownAndUpKeepsTheSocketAndForgetsWhatWasInFlight) {
  bus();
  kernel.stall();
  bus().send(makeFrame(kOwn));
  kernel.down();
  read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  EXPECT_EQ(bus().inFlight(), 0u);
  expectTrouble("can0 is down: ip link set can0 up");
  bus().discard();
  EXPECT_EQ(kernel.cycles, 0) << "what an operator took down is not taken up";
  kernel.up();
  read();
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
  EXPECT_EQ(kernel.opened, 1);
}

TEST_F(SocketCanBusTest, ALinkThatWasDownForAMomentIsToldAllTheSame) {
  bus();
  kernel.down();
  kernel.up();
  read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, OfAnInterruptionThatIsOverItSaysNothing) {
  bus();
  kernel.down();
  kernel.up();
  read();
  ASSERT_EQ(bus().state(), BusState::kDown);
  EXPECT_EQ(bus().trouble(), "");
}

TEST_F(SocketCanBusTest, AWriteToALinkThatWentDownIsFoundByItsError) {
  bus();
  kernel.link.up = false;
  EXPECT_FALSE(bus().send(makeFrame(kOwn)));
  EXPECT_EQ(bus().state(), BusState::kDown);
}

TEST_F(SocketCanBusTest, AVanishedInterfaceIsOpenedAnewOnceItIsBackAndConfigured) {
  bus();
  kernel.stall();
  bus().send(makeFrame(kOwn));
  kernel.stalled = false;
  kernel.unplug();
  read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  EXPECT_EQ(bus().inFlight(), 0u);
  expectTrouble("no interface can0");
  kernel.plug();
  read();
  EXPECT_EQ(kernel.opened, 2);
  expectTrouble("can0 has no bit rate");
  kernel.configure();
  read();
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
  EXPECT_TRUE(bus().send(makeFrame(kOwn)));
  read();
  EXPECT_EQ(bus().confirmed(), 1u);
  EXPECT_EQ(bus().late(), 0u);
}

TEST_F(SocketCanBusTest, AVanishedInterfaceOfWhichNetlinkAloneTellsIsClosed) {
  bus();
  kernel.link = CanLink();
  kernel.changes.push_back(kernel.link);
  read();
  EXPECT_FALSE(kernel.attached);
  EXPECT_EQ(bus().state(), BusState::kDown);
  expectTrouble("no interface can0");
}

TEST_F(SocketCanBusTest, ACycleOfWhichNothingWasToldCounts) {
  kernel.silent_cycle = true;
  bus();
  kernel.stall();
  bus().send(makeFrame(kOwn));
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(bus().state(), BusState::kActive);
  EXPECT_EQ(bus().inFlight(), 0u);
}

TEST_F(SocketCanBusTest, AfterACycleOfWhichNothingWasToldTheLinkIsAskedHowItIs) {
  kernel.silent_cycle = true;
  bus();
  kernel.link.state = BusState::kBusOff;
  kernel.changes.push_back(kernel.link);
  read();
  bus().discard();
  for (int i = 0; i < 10; ++i) read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, AnEchoThatWasNotExpectedIsALateOne) {
  bus();
  kernel.transmit(makeFrame(kOwn));
  read();
  EXPECT_EQ(bus().late(), 1u);
  EXPECT_EQ(bus().inFlight(), 0u);
}

TEST_F(SocketCanBusTest, AWriteToAVanishedInterfaceIsFoundByItsError) {
  bus();
  kernel.attached = false;
  kernel.link = CanLink();
  EXPECT_FALSE(bus().send(makeFrame(kOwn)));
  EXPECT_EQ(bus().state(), BusState::kDown);
}

TEST_F(SocketCanBusTest, MayStartBeforeItsInterface) {
  kernel.unplug();
  kernel.inbox.clear();
  read();
  EXPECT_EQ(bus().state(), BusState::kDown);
  kernel.plug();
  kernel.configure();
  read();
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, AnInterfaceThatCannotBeOpenedSaysWhyAndIsTriedAnew) {
  kernel.open_error = EPERM;
  EXPECT_EQ(bus().state(), BusState::kDown);
  expectTrouble("can0 cannot be opened: Operation not permitted");
  kernel.open_error = 0;
  kernel.changes.push_back(kernel.link);
  read();
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, DoesNotUseAControllerThatRestartsItself) {
  kernel.link.restart_ms = 100;
  EXPECT_EQ(bus().state(), BusState::kDown);
  EXPECT_FALSE(bus().send(makeFrame(kOwn)));
  expectTrouble("type can restart-ms 0");
}

TEST_F(SocketCanBusTest, DoesNotUseADriverWhoseEchoProvesNothing) {
  kernel.link.echoes = false;
  EXPECT_EQ(bus().state(), BusState::kDown);
  expectTrouble("does not echo");
}

TEST_F(SocketCanBusTest, AVirtualInterfaceNeedsNeither) {
  kernel.link.controller = kernel.link.echoes = kernel.link.configured = false;
  EXPECT_EQ(bus().state(), BusState::kActive);
}

TEST_F(SocketCanBusTest, AVirtualInterfaceThatIsDownIsNotAskedForABitRate) {
  kernel.link.controller = kernel.link.echoes = kernel.link.configured = false;
  bus();
  kernel.down();
  read();
  EXPECT_EQ(bus().trouble(), "can0 is down: ip link set can0 up");
}

TEST_F(SocketCanBusTest, AVirtualInterfaceWithAFullQueueIsStuck) {
  kernel.link.controller = kernel.link.echoes = kernel.link.configured = false;
  bus();
  kernel.stall();
  while (bus().send(makeFrame(kOwn))) {
  }
  EXPECT_EQ(bus().trouble(), "frames are stuck in the queue of can0");
}

TEST(CanSocketTest, RefusesNamesThatNoInterfaceCanHave) {
  for (const char* name : {"", "can0 ", "a/b", "..", "--help;", "abcdefghijklmnop"}) {
    EXPECT_THROW(openCanSocket(name, ""), std::invalid_argument) << name;
  }
}

}  // namespace
}  // namespace tunnel_pilot::can
