// The bridge on real SocketCAN with two controllers on one bus, on the machine of scripts/can_machine.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <random>
#include <set>

#include "options.h"
#include "rig.h"
#include "tunnel_pilot/can/layout.h"

namespace tunnel_pilot::bridge {
namespace {

using can::BusState;

/// Worst figures of one kind of fault: a line of the table.
struct Row {
  int count = 0;
  double stop = 0.0;      ///< [s]
  double recovery = 0.0;  ///< [s]
  double age = 0.0;       ///< [s]
  void print(const std::string& name) const {
    std::printf("TABLE | %s | %d | %.1f | %.1f | %.0f |\n", name.c_str(), count, 1e3 * stop,
                1e3 * recovery, 1e3 * age);
  }
};

class CanMachine : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    std::printf(
        "TABLE | fault | times | STOP after [ms] | confirmed again after [ms] | "
        "oldest frame [ms] |\nTABLE |---|---|---|---|---|\n");
  }

  /// Provokes a fault while driving: it stops in time, and for that reason.
  /// `deafens`: no frame of the truck's comes any more either, which may be seen first.
  void expectStop(const std::function<void()>& fault, bool deafens = false) {
    ASSERT_TRUE(pilot->drive()) << toString(pilot->state()) << " " << pilot->bus->trouble();
    pilot->run(0.001 * static_cast<double>(random() % 20));
    truck.takeWorstAge();
    pilot->stopped_at = Stamp{};
    const Injection injection(fault);
    ASSERT_TRUE(pilot->run(2.0, [&] { return pilot->stopped_at != Stamp{} && injection.done(); }));
    fault_at = injection.begin();
    const double stop = toSeconds(pilot->stopped_at - fault_at);
    EXPECT_LE(stop, kStopLimit + std::min(toSeconds(injection.end() - fault_at), kLongestAct));
    const supervision::Reason reason = pilot->bridge->status().reason;
    EXPECT_TRUE(reason == supervision::Reason::kBusFault ||
                (deafens && reason == supervision::Reason::kFeedbackStale))
        << supervision::toString(reason);
    row.stop = std::max(row.stop, stop);
    ++row.count;
  }

  /// From `back`, when the bus was there again: a confirmed frame, nothing old, nothing armed.
  void expectRecovery(Stamp back, double limit) {
    const std::uint64_t confirmed = pilot->bus->confirmed();
    ASSERT_TRUE(pilot->run(5.0, [&] {
      return pilot->busWorks() && pilot->bus->confirmed() > confirmed;
    })) << pilot->bus->trouble();
    const double recovery = toSeconds(steadyTime() - back);
    EXPECT_LE(recovery, limit);
    row.recovery = std::max(row.recovery, recovery);
    EXPECT_TRUE(pilot->run(3.0, [&] { return pilot->state() == SafetyState::kStopped; }));
    pilot->run(0.3);
    EXPECT_EQ(pilot->state(), SafetyState::kStopped);
    EXPECT_FALSE(pilot->armed_by_itself);
    row.age = std::max(row.age, truck.takeWorstAge());
    EXPECT_LE(row.age, kAgeLimit) << "a stale frame";
  }

  Truck truck;
  std::unique_ptr<Pilot> pilot = std::make_unique<Pilot>();
  std::minstd_rand random{seed()};
  Stamp fault_at{};
  Row row;
};

TEST_F(CanMachine, DrivesWithEveryFrameConfirmed) {
  ASSERT_TRUE(pilot->drive()) << toString(pilot->state()) << " " << pilot->bus->trouble();
  truck.takeWorstAge();
  const std::uint64_t sent = pilot->bridge->status().frames_sent - pilot->bus->inFlight();
  const std::uint64_t confirmed = pilot->bus->confirmed();
  const std::uint64_t late = pilot->bus->late();
  pilot->run(times(3, 60));
  row.age = truck.takeWorstAge();
  EXPECT_EQ(pilot->bridge->status().frames_sent - sent,
            pilot->bus->confirmed() - confirmed + pilot->bus->inFlight());
  EXPECT_EQ(pilot->bus->late(), late);
  EXPECT_EQ(pilot->state(), SafetyState::kActive)
      << supervision::toString(pilot->bridge->status().reason);
  row.print("none");
}

TEST_F(CanMachine, TakesNothingFromTheHeapOnceItDrives) {
  ASSERT_TRUE(pilot->drive()) << toString(pilot->state()) << " " << pilot->bus->trouble();
  ASSERT_TRUE(allocationsAreCounted());
  pilot->allocations = 0;
  pilot->run(times(3, 60));
  EXPECT_EQ(pilot->state(), SafetyState::kActive);
  EXPECT_EQ(pilot->allocations, 0);
}

TEST_F(CanMachine, BusOff) {
  for (int i = 0; i < times(5, 1000) && !HasFatalFailure(); ++i) {
    expectStop([] { provoke("bus_off"); });
    if (!HasFatalFailure()) expectRecovery(fault_at, kOutageLimit);
  }
  row.print("bus-off (from the fault; the helper cycles the link)");
}

TEST_F(CanMachine, StalledQueue) {
  for (int i = 0; i < times(4, 200) && !HasFatalFailure(); ++i) {
    expectStop([] { provoke("stop_queue"); });
    if (!HasFatalFailure()) expectRecovery(fault_at, kOutageLimit);
  }
  row.print("stalled queue (likewise)");
}

TEST_F(CanMachine, HungController) {
  for (int i = 0; i < times(4, 200) && !HasFatalFailure(); ++i) {
    expectStop([] { hangController("can0"); }, true);
    if (!HasFatalFailure()) expectRecovery(fault_at, kOutageLimit);
  }
  row.print("hung controller (likewise)");
}

TEST_F(CanMachine, LinkDownAndUp) {
  for (int i = 0; i < times(4, 1000) && !HasFatalFailure(); ++i) {
    expectStop([] { setLink("can0", false); });
    if (HasFatalFailure()) break;
    pilot->run(0.2);
    const Injection up([] { setLink("can0", true); });
    while (!up.begun()) pilot->run(0.005);
    expectRecovery(up.begin(), kRecoveryLimit);
  }
  row.print("link down and up (from the up)");
}

TEST_F(CanMachine, UnpluggedAndBack) {
  for (int i = 0; i < times(2, 200) && !HasFatalFailure(); ++i) {
    expectStop([] { unplug("can0"); });
    if (HasFatalFailure()) break;
    EXPECT_NE(pilot->bus->trouble().find("no interface can0"), std::string::npos);
    const Injection back([] {
      rescan();
      while (access("/sys/class/net/can0", F_OK) != 0) usleep(1000);
    });
    ASSERT_TRUE(pilot->run(5.0, [&] { return back.done(); }));
    pilot->run(0.1);
    EXPECT_NE(pilot->bus->trouble().find("can0 has no bit rate"), std::string::npos)
        << pilot->bus->trouble();
    const Injection configured([] { configure("can0"); });
    ASSERT_TRUE(pilot->run(5.0, [&] { return configured.done(); }));
    const Injection up([] { setLink("can0", true); });
    while (!up.begun()) pilot->run(0.005);
    expectRecovery(up.begin(), kRecoveryLimit);
  }
  row.print("unplugged and back (from the up)");
}

TEST_F(CanMachine, BusOffBeforeTheStart) {
  provoke("bus_off");
  usleep(100000);
  pilot = std::make_unique<Pilot>();
  EXPECT_EQ(pilot->bus->state(), BusState::kBusOff);
  const std::uint64_t confirmed = pilot->bus->confirmed();
  EXPECT_TRUE(pilot->run(2.0, [&] { return pilot->bus->confirmed() > confirmed; }));
  EXPECT_TRUE(pilot->drive());
}

TEST_F(CanMachine, WarningAndPassiveAreToldAndDoNotStop) {
  ASSERT_TRUE(pilot->drive());
  for (const auto& [word, state] :
       {std::pair("warning", BusState::kWarning), std::pair("passive", BusState::kPassive),
        std::pair("active", BusState::kActive)}) {
    provoke(word);
    EXPECT_TRUE(pilot->run(0.5, [&, s = state] { return pilot->bus->state() == s; })) << word;
  }
  EXPECT_EQ(pilot->state(), SafetyState::kActive);
}

TEST_F(CanMachine, ATimeoutOfTheTransmitter) {
  expectStop([] { provoke("timeout"); });
  if (!HasFatalFailure()) expectRecovery(fault_at, kOutageLimit);
  row.print("transmitter's timeout");
}

TEST_F(CanMachine, WithoutTheHelperAStallWaitsForAnOperator) {
  pilot = std::make_unique<Pilot>("/nowhere/can_link_cycle");
  expectStop([] { provoke("stop_queue"); });
  ASSERT_FALSE(HasFatalFailure());
  pilot->run(1.5);
  EXPECT_FALSE(pilot->busWorks());
  EXPECT_NE(pilot->bus->trouble().find("it is not installed"), std::string::npos)
      << pilot->bus->trouble();
  const std::uint64_t confirmed = pilot->bus->confirmed();
  pilot->run(0.5);
  EXPECT_EQ(pilot->bus->confirmed(), confirmed);
  const Injection cycle([] {
    setLink("can0", false);
    setLink("can0", true);
  });
  ASSERT_TRUE(pilot->run(5.0, [&] { return cycle.done(); }));
  expectRecovery(cycle.begin(), kOutageLimit);
  row.print("stalled queue without the helper (from the operator's cycle)");
}

// Shows, too, that old frames are found where there are some.
TEST_F(CanMachine, AQueueThatGoesOnByItselfSendsAtMostSixOldFramesAndIsNotTrusted) {
  pilot = std::make_unique<Pilot>("/nowhere/can_link_cycle");
  expectStop([] { provoke("stop_queue"); });
  ASSERT_FALSE(HasFatalFailure());
  pilot->run(1.0);
  truck.takeWorstAge();
  provoke("wake_queue");
  pilot->run(0.5);
  EXPECT_GE(pilot->bus->late(), 1u);
  EXPECT_LE(pilot->bus->late(), 6u);
  EXPECT_GE(truck.takeWorstAge(), 0.9);
  EXPECT_FALSE(pilot->busWorks());
  setLink("can0", false);
  setLink("can0", true);
}

TEST_F(CanMachine, AForeignFrameFromTheBusStops) {
  expectStop([] {
    const auto other = can::openCanSocket("can1", "");
    other->open({});
    other->send(*can::encode(can::TruckCommandFrame()));
  });
  row.print("foreign sender on the bus");
}

TEST_F(CanMachine, AForeignFrameFromAnotherProgramOfTheMachineStops) {
  expectStop([] {
    const auto other = can::openCanSocket("can0", "");
    other->open({});
    other->send(*can::encode(can::TruckCommandFrame()));
  });
  row.print("foreign sender on the same interface");
}

TEST_F(CanMachine, DoesNotUseAControllerThatRestartsItself) {
  setLink("can0", false);
  ASSERT_EQ(std::system("/sbin/ip link set can0 type can restart-ms 100"), 0);
  setLink("can0", true);
  pilot = std::make_unique<Pilot>();
  EXPECT_FALSE(pilot->busWorks());
  EXPECT_NE(pilot->bus->trouble().find("restart-ms 0"), std::string::npos) << pilot->bus->trouble();
  setLink("can0", false);
  configure("can0");
  setLink("can0", true);
}

// -------- the filters of the kernel

TEST(CanMachineFilters, LetThroughTheListAlone) {
  can::SocketCanBus bus("can0", allIdentifiers(), can::openCanSocket("can0", ""));
  const auto other = can::openCanSocket("can1", "");
  ASSERT_EQ(other->open({}), 0);
  std::set<std::uint32_t> heard;
  std::uint64_t sent = 0;
  const auto listen = [&] {
    while (const auto frame = bus.receive()) {
      EXPECT_FALSE(frame->extended);
      heard.insert(frame->id);
    }
  };
  const auto say = [&](std::uint32_t id, bool extended) {
    can::Frame frame;
    frame.id = id;
    frame.extended = extended;
    while (other->send(frame) != 0) {
      usleep(200);
      listen();
    }
    ++sent;
    if (sent % 8 == 0) listen();
  };
  for (std::uint32_t id = 0; id < 0x800; ++id) say(id, false);
  std::minstd_rand random(seed());
  const long many = times(2000, 1000000);
  for (const can::Identifier& own : allIdentifiers()) say(own.id, true);
  for (long i = 0; i < many; ++i) say(static_cast<std::uint32_t>(random()) & 0x1FFFFFFF, true);
  usleep(200000);
  listen();
  std::set<std::uint32_t> expected;
  for (const can::Identifier& own : allIdentifiers()) expected.insert(own.id);
  EXPECT_EQ(heard, expected);
  EXPECT_EQ(bus.discarded(), 0u) << "the kernel let more through";
  std::printf("TABLE filters: %llu identifiers sent, %zu heard\n", static_cast<unsigned long long>(sent),
              heard.size());
}

// -------- the helper

int runHelper(const std::vector<const char*>& arguments, uid_t user = 0) {
  const pid_t child = fork();
  if (child == 0) {
    std::vector<char*> list{const_cast<char*>("can_link_cycle")};
    for (const char* argument : arguments) list.push_back(const_cast<char*>(argument));
    list.push_back(nullptr);
    if (user != 0 && setuid(user) != 0) _exit(98);
    execv(TUNNEL_PILOT_NODE_FOLDER "/can_link_cycle", list.data());
    _exit(97);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(CanLinkCycle, TakesOneInterfaceOfCanThatIsUp) {
  EXPECT_EQ(runHelper({"can0"}), 0);
  EXPECT_EQ(runHelper({"vcan0"}), 0);
  EXPECT_EQ(runHelper({}), 2);
  EXPECT_EQ(runHelper({"can0", "can1"}), 2);
  for (const char* name : {"", "lo", "can7", "can0 ", "can0;", "../can0", "0123456789abcdef0"}) {
    EXPECT_EQ(runHelper({name}), 2) << name;
  }
}

TEST(CanLinkCycle, LeavesALinkThatIsDownAlone) {
  setLink("vcan0", false);
  EXPECT_EQ(runHelper({"vcan0"}), 2);
  setLink("vcan0", true);
}

TEST(CanLinkCycle, SaysThatItMayNot) { EXPECT_EQ(runHelper({"can0"}, 65534), 3); }

}  // namespace
}  // namespace tunnel_pilot::bridge
