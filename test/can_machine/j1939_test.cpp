// The J1939 profile on real SocketCAN: the claim, and other claimants of the pilot's address, the
// kernel's own among them (j1939acd of can-utils, on can1).
#include "tunnel_pilot/can/j1939.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "options.h"
#include "recorder.h"
#include "rig.h"

namespace tunnel_pilot::bridge {
namespace {

constexpr double kSilenceLimit = 0.250;  // [s] from the claim under a lower NAME
constexpr auto kHelper = TUNNEL_PILOT_NODE_FOLDER "/can_link_cycle";

/// j1939acd on can1, which claims the pilot's address and no other.
class KernelClaimant {
 public:
  KernelClaimant(std::uint64_t name, std::uint8_t address) {
    char number[20];
    std::snprintf(number, sizeof number, "%016llx", static_cast<unsigned long long>(name));
    const std::string range = std::to_string(address);
    process_ = fork();
    if (process_ != 0) return;
    execl("/usr/bin/j1939acd", "j1939acd", "-r", range.c_str(), "-a", range.c_str(), number, "can1",
          nullptr);
    _exit(97);
  }
  ~KernelClaimant() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
  }

 private:
  pid_t process_;
};

class CanMachineJ1939 : public testing::Test {
 protected:
  void SetUp() override {
    cleanLinks();
    truck = std::make_unique<Truck>(can::ProfileKind::kJ1939);
  }

  void start() {
    pilot.reset();
    pilot = std::make_unique<Pilot>(kHelper, can::ProfileKind::kJ1939);
    pilot->event = [this](const std::string& words, Stamp at) { recorder.event(words, at); };
    recorder.event("start", steadyTime());
  }

  void TearDown() override {
    pilot.reset();
    truck.reset();  // silence
    recorder.handOver(testing::UnitTest::GetInstance()->current_test_info()->name(), "j1939");
  }

  /// What is wrong, in words.
  std::string tale() const {
    return toString(pilot->state()) + ", " + supervision::toString(pilot->bridge->status().reason) +
           ", " + pilot->network->trouble();
  }

  bool isPilots(const can::Frame& frame) const {
    const can::J1939Id id = can::fromIdentifier(frame.id);
    return frame.extended && id.source == own.source_address && id.pgn != can::kAddressClaimedPgn;
  }

  static std::uint64_t nameIn(const can::Frame& frame) {
    std::uint64_t name = 0;
    for (std::size_t i = 0; i < 8; ++i) name |= std::uint64_t{frame.data[i]} << 8 * i;
    return name;
  }

  can::Frame claimOf(std::uint64_t name) const {
    can::Frame frame;
    frame.id = can::toIdentifier({6, can::kAddressClaimedPgn, can::kGlobalAddress, own.source_address});
    frame.extended = true;
    frame.length = 8;
    for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(name >> 8 * i);
    return frame;
  }

  /// When somebody claimed the pilot's address under this NAME, since `begin`.
  std::optional<Stamp> claimed(std::uint64_t name, Stamp begin) const {
    for (const auto& [stamp, frame] : recorder.since(begin)) {
      const can::J1939Id id = can::fromIdentifier(frame.id);
      const bool claim =
          frame.extended && id.pgn == can::kAddressClaimedPgn && id.source == own.source_address;
      if (claim && nameIn(frame) == name) return stamp;
    }
    return std::nullopt;
  }

  /// The address is taken at `lost`: it stops, is silent, and stays so. Returns when its last frame
  /// came.
  double expectSilence(Stamp lost) {
    EXPECT_TRUE(pilot->run(3.0, [&] { return pilot->state() == SafetyState::kStopped; }));
    pilot->run(0.5);
    double last = 0.0;
    for (const auto& [stamp, frame] : recorder.since(lost))
      if (isPilots(frame)) last = toSeconds(stamp - lost);
    EXPECT_LE(last, kSilenceLimit);
    EXPECT_EQ(pilot->bridge->status().reason, supervision::Reason::kBusFault);
    EXPECT_FALSE(pilot->bridge->reset(steadyTime()).accepted);
    EXPECT_NE(pilot->network->trouble().find("is lost to NAME"), std::string::npos)
        << pilot->network->trouble();
    return last;
  }

  const can::J1939Parameters own = profileOf(can::Side::kPilot, can::ProfileKind::kJ1939).j1939;
  Recorder recorder;
  std::unique_ptr<Truck> truck;
  std::unique_ptr<Pilot> pilot;
  std::minstd_rand random{seed()};
};

TEST_F(CanMachineJ1939, ClaimsBeforeAllElseAndDrives) {
  const Stamp begin = steadyTime();
  start();
  ASSERT_TRUE(pilot->drive()) << tale();
  ASSERT_TRUE(allocationsAreCounted());
  pilot->allocations = 0;
  pilot->run(times(2, 30));
  EXPECT_EQ(pilot->state(), SafetyState::kActive);
  EXPECT_EQ(pilot->allocations, 0);
  const auto claim = claimed(own.name, begin);
  ASSERT_TRUE(claim);
  for (const auto& [stamp, frame] : recorder.since(begin)) {
    if (!isPilots(frame)) continue;
    EXPECT_GE(toSeconds(stamp - *claim), 0.250);
    break;
  }
}

TEST_F(CanMachineJ1939, ALowerNameSilencesItInTime) {
  double worst = 0.0, stop = 0.0;
  const int many = times(5, 200);
  for (int i = 0; i < many && !HasFatalFailure(); ++i) {
    start();
    ASSERT_TRUE(pilot->drive()) << tale();
    pilot->run(0.001 * static_cast<double>(random() % 20));
    pilot->stopped_at = Stamp{};
    const Injection claim([this] {
      const auto other = can::openCanSocket("can1", "");
      other->open({});
      other->send(claimOf(own.name - 1));
    });
    ASSERT_TRUE(pilot->run(2.0, [&] { return pilot->stopped_at != Stamp{}; }));
    const auto lost = claimed(own.name - 1, claim.begin());
    ASSERT_TRUE(lost);
    stop = std::max(stop, toSeconds(pilot->stopped_at - *lost));
    worst = std::max(worst, expectSilence(*lost));
  }
  std::printf("TABLE | J1939: claim under a lower NAME | %d | %.1f | last frame after %.1f | |\n", many,
              1e3 * stop, 1e3 * worst);
}

TEST_F(CanMachineJ1939, TheKernelsClaimantWithALowerNameTakesTheAddress) {
  start();
  ASSERT_TRUE(pilot->drive()) << tale();
  const Stamp begin = steadyTime();
  pilot->stopped_at = Stamp{};
  const KernelClaimant claimant(own.name - 1, own.source_address);
  ASSERT_TRUE(pilot->run(5.0, [&] { return pilot->stopped_at != Stamp{}; })) << "j1939acd did not claim";
  const auto lost = claimed(own.name - 1, begin);
  ASSERT_TRUE(lost);
  const double stop = toSeconds(pilot->stopped_at - *lost);
  const double last = expectSilence(*lost);
  std::printf("TABLE | J1939: j1939acd with a lower NAME | 1 | %.1f | last frame after %.1f | |\n",
              1e3 * stop, 1e3 * last);
}

TEST_F(CanMachineJ1939, TheKernelsClaimantWithAHigherNameIsAnsweredAndChangesNothing) {
  start();
  ASSERT_TRUE(pilot->drive()) << tale();
  const Stamp begin = steadyTime();
  const KernelClaimant claimant(own.name + 1, own.source_address);
  pilot->run(3.0);
  EXPECT_EQ(pilot->state(), SafetyState::kActive);
  EXPECT_TRUE(claimed(own.name, begin)) << "nobody asked, or it was not answered";
  EXPECT_FALSE(pilot->armed_by_itself);
}

TEST_F(CanMachineJ1939, ABusThatWasOffIsClaimedAnewBeforeFramesGoOn) {
  start();
  for (int i = 0; i < times(3, 50) && !HasFatalFailure(); ++i) {
    ASSERT_TRUE(pilot->drive()) << tale();
    pilot->run(0.001 * static_cast<double>(random() % 20));
    const Stamp begin = steadyTime();
    provoke("bus_off");
    ASSERT_TRUE(pilot->run(1.0, [&] { return !pilot->busWorks(); }));
    ASSERT_TRUE(pilot->run(1.0, [&] { return pilot->busWorks(); })) << pilot->network->trouble();
    EXPECT_TRUE(claimed(own.name, begin));
    pilot->run(0.3);
    EXPECT_FALSE(pilot->armed_by_itself);
  }
}

}  // namespace
}  // namespace tunnel_pilot::bridge
