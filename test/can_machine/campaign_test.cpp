// Random faults of the kernel's CAN, one after the other and into each other: what is asked of each kind
// while ACTIVE, and of all, that the bridge comes back, is never armed by itself and is judged by the
// monitor of test/bus_monitor.
#include <gtest/gtest.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <random>

#include "options.h"
#include "recorder.h"
#include "rig.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/linux_frame.h"
#include "tunnel_pilot/can/log_writer.h"

namespace tunnel_pilot::bridge {
namespace {

void wait(double seconds) { usleep(static_cast<useconds_t>(1e6 * seconds)); }

/// A participant that says whatever it likes.
class Stranger {
 public:
  explicit Stranger(const std::string& interface)
      : socket_(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex(interface.c_str()));
    good_ = setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0) == 0 &&
            bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  }
  ~Stranger() { close(socket_); }
  void say(const can_frame& frame) const {
    if (good_ && write(socket_, &frame, sizeof(frame)) < 0)
      wait(0.0002);  // a full queue, a link that is down
  }

 private:
  int socket_;
  bool good_ = false;
};

/// What the bridge has to do about a fault while ACTIVE.
enum class Answer { kStop, kAsItMay, kDriveOn };

class CanMachineCampaign : public testing::Test {
 protected:
  using Act = std::function<void()>;
  struct Kind {
    const char* name;
    const char* interface;
    Answer answer;
    Act (CanMachineCampaign::*draw)(const std::string& interface);
    bool deafens = false;  ///< which may be seen first
    int old_sets = 0;      ///< may come, of a queue that goes on before the helper has emptied it
    int count = 0, while_active = 0, stops = 0;
    double stop = 0.0, recovery = 0.0, age = 0.0;  ///< worst [s]
  };

  void TearDown() override { end(); }

  double random(double low, double high) { return std::uniform_real_distribution<>(low, high)(engine); }
  int random(int below) { return static_cast<int>(engine() % static_cast<unsigned>(below)); }

  can_frame frameOf(std::uint32_t id) {
    can_frame frame{};
    frame.can_id = id;
    frame.can_dlc = 8;
    for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(engine());
    return frame;
  }
  static Act said(const std::string& interface, const std::vector<can_frame>& frames) {
    return [=] {
      const Stranger stranger(interface);
      for (const can_frame& frame : frames) stranger.say(frame);
    };
  }

  // -------- the faults

  Act busOff(const std::string& interface) {
    return [=] { provoke("bus_off", interface); };
  }
  Act stall(const std::string& interface) {
    return [=] { provoke("stop_queue", interface); };
  }
  Act timeout(const std::string& interface) {
    return [=] { provoke("timeout", interface); };
  }
  Act errorState(const std::string& interface) {
    static const std::array<const char*, 3> kWords{"warning", "passive", "active"};
    return [=, word = kWords[static_cast<std::size_t>(random(3))]] { provoke(word, interface); };
  }
  Act lateFrames(const std::string& interface) {
    return [=, seconds = random(0.001, 0.1)] {
      provoke("stop_queue", interface);
      wait(seconds);
      provoke("wake_queue", interface);
    };
  }
  Act hang(const std::string& interface) {
    return [=] { hangController(interface); };
  }
  Act linkDown(const std::string& interface) {
    return [=, seconds = random(0.0, 0.1)] {
      setLink(interface, false);
      wait(seconds);
      setLink(interface, true);
    };
  }
  Act foreign(const std::string& interface) {
    static const std::array<std::uint32_t, 3> kIds{can::kTpCommandId, can::kTpCommandInfoId,
                                                   can::kTpStatusId};
    const can_frame frame = frameOf(kIds[static_cast<std::size_t>(random(3))]);
    return [=, text = "foreign " + can::toText(*can::fromLinux(frame))] {
      recorder->event(text, steadyTime());
      said(interface, {frame})();
    };
  }
  // A remote frame here asks for no bytes: of any other, the emulated controller keeps bytes that it
  // does not release, and reads its queue askew from then on.
  Act corrupt(const std::string& interface) {
    std::vector<can_frame> frames;
    for (int i = random(5); i >= 0; --i) {
      can_frame frame = frameOf(static_cast<std::uint32_t>(can::kTruckFeedbackId + random(6)));
      if (random(3) == 0) frame.can_dlc = static_cast<__u8>(random(8));
      if (random(4) == 0) {
        frame.can_id |= CAN_RTR_FLAG;
        frame.can_dlc = 0;
      }
      frames.push_back(frame);
    }
    return said(interface, frames);
  }
  Act flood(const std::string& interface) {
    std::vector<can_frame> frames;
    for (int i = random(100); i >= 0; --i) {
      const bool is_long = random(2) == 0;
      frames.push_back(frameOf(is_long
                                   ? static_cast<std::uint32_t>(engine() & CAN_EFF_MASK) | CAN_EFF_FLAG
                                   : static_cast<std::uint32_t>(0x200 + random(0x600))));
    }
    return said(interface, frames);
  }
  // Without netem's corruption, which makes remote frames of some.
  Act badWire(const std::string& interface) {
    static const std::array<const char*, 4> kHow{"loss 30%", "delay 20ms 20ms", "duplicate 30%",
                                                 "delay 10ms reorder 50%"};
    return
        [=, how = std::string(kHow[static_cast<std::size_t>(random(4))]), seconds = random(0.02, 0.3)] {
          tunnel_pilot::bridge::run("/sbin/tc qdisc replace dev " + interface + " root netem limit 10 " +
                                    how);
          wait(seconds);
          tunnel_pilot::bridge::run("/sbin/tc qdisc del dev " + interface + " root");
        };
  }

  // -------- a drive and its faults

  void begin() {
    end();
    cleanLinks();
    recorder = std::make_unique<Recorder>();
    truck = std::make_unique<Truck>();
    pilot = std::make_unique<Pilot>();
    pilot->event = [this](const std::string& words, Stamp at) { recorder->event(words, at); };
    recorder->event("start", steadyTime());
  }
  void end() {
    pilot.reset();
    truck.reset();
    if (recorder) recorder->handOver("RandomFaults_" + std::to_string(++drives), "plain");
    recorder.reset();
  }

  void inject(Kind& kind, bool active) {
    const Stamp begin = steadyTime();
    pilot->stopped_at = Stamp{};
    const Injection injection((this->*kind.draw)(kind.interface), random(0.0, 0.02));
    ASSERT_TRUE(pilot->run(10.0, [&] { return injection.done(); }));
    ++kind.count;
    if (active) expectAnswer(kind, injection);
    if (!HasFatalFailure()) expectRecovery(kind, begin, injection.end());
    if (active && pilot->stopped_at != Stamp{}) ++kind.stops;
  }

  void expectAnswer(Kind& kind, const Injection& injection) {
    ++kind.while_active;
    if (kind.answer == Answer::kDriveOn) {
      pilot->run(0.1);
      EXPECT_EQ(pilot->state(), SafetyState::kActive);
    }
    if (kind.answer != Answer::kStop) return;
    ASSERT_TRUE(pilot->run(2.0, [&] { return pilot->stopped_at != Stamp{}; }));
    const double stop = toSeconds(pilot->stopped_at - injection.begin());
    EXPECT_GE(stop, 0.0) << "stopped for something else";
    EXPECT_LE(stop, kStopLimit + std::min(toSeconds(injection.end() - injection.begin()), kLongestAct));
    const supervision::Reason reason = pilot->bridge->status().reason;
    EXPECT_TRUE(reason == supervision::Reason::kBusFault ||
                (kind.deafens && reason == supervision::Reason::kFeedbackStale))
        << supervision::toString(reason);
    kind.stop = std::max(kind.stop, stop);
  }

  /// A confirmed frame in time, nothing old, nothing armed.
  void expectRecovery(Kind& kind, Stamp begin, Stamp end) {
    const std::uint64_t confirmed = pilot->bus->confirmed();
    ASSERT_TRUE(pilot->run(5.0, [&] {
      return pilot->busWorks() && pilot->bus->confirmed() > confirmed;
    })) << pilot->bus->trouble();
    const double recovery = toSeconds(steadyTime() - end);
    EXPECT_LE(recovery, kOutageLimit);
    kind.recovery = std::max(kind.recovery, recovery);
    pilot->run(random(0.0, 0.2));
    EXPECT_FALSE(pilot->armed_by_itself);
    if (kind.draw == &CanMachineCampaign::foreign) return;  // the stranger's may tell of any age
    const std::vector<double> ages = agesSince(begin);
    const auto old = std::count_if(ages.begin(), ages.end(), [](double age) { return age > kAgeLimit; });
    EXPECT_LE(old, kind.old_sets) << "stale frames";
    EXPECT_FALSE(old > 0 && isEngaged(pilot->state()));
    for (const double age : ages) kind.age = std::max(kind.age, age);
  }

  /// Of the measurements that sets of the bridge's told of when they were on the bus [s]. Not of what
  /// the truck heard: the emulated controller keeps what it received over a hang, and hands it up after.
  std::vector<double> agesSince(Stamp begin) const {
    std::vector<double> ages;
    for (const auto& [stamp, frame] : recorder->since(begin))
      if (frame.id == can::kTpCommandInfoId && !frame.extended)
        ages.push_back(1e-3 * static_cast<double>(ageOf(frame, stamp)));
    return ages;
  }

  void printTable() const {
    std::printf(
        "TABLE | fault | times | while ACTIVE | stops | STOP after [ms] | confirmed again after its end "
        "[ms] | oldest frame [ms] |\nTABLE |---|---|---|---|---|---|---|\n");
    for (const Kind& kind : kinds) {
      std::printf("TABLE | %s | %d | %d | %d | ", kind.name, kind.count, kind.while_active, kind.stops);
      if (kind.answer == Answer::kStop) std::printf("%.1f", 1e3 * kind.stop);
      std::printf(" | ");
      if (kind.answer != Answer::kDriveOn) std::printf("%.1f", 1e3 * kind.recovery);
      std::printf(" | %.0f |\n", 1e3 * kind.age);
    }
  }

  using C = CanMachineCampaign;
  std::array<Kind, 20> kinds{
      {{"bus-off", "can0", Answer::kStop, &C::busOff},
       {"truck's bus-off", "can1", Answer::kAsItMay, &C::busOff},
       {"stalled queue", "can0", Answer::kStop, &C::stall},
       {"truck's stalled queue", "can1", Answer::kAsItMay, &C::stall},
       {"late frames", "can0", Answer::kAsItMay, &C::lateFrames, false, 2},
       {"truck's late frames", "can1", Answer::kAsItMay, &C::lateFrames},
       {"hung controller", "can0", Answer::kStop, &C::hang, true},
       {"truck's hung controller", "can1", Answer::kAsItMay, &C::hang},
       {"link down and up", "can0", Answer::kStop, &C::linkDown},
       {"truck's link down and up", "can1", Answer::kAsItMay, &C::linkDown},
       {"transmitter's timeout", "can0", Answer::kStop, &C::timeout},
       {"truck's transmitter's timeout", "can1", Answer::kAsItMay, &C::timeout},
       {"error state told", "can0", Answer::kDriveOn, &C::errorState},
       {"error state told to the truck", "can1", Answer::kDriveOn, &C::errorState},
       {"foreign sender on the bus", "can1", Answer::kStop, &C::foreign},
       {"foreign sender on the same interface", "can0", Answer::kStop, &C::foreign},
       {"corrupt frames of the truck", "can1", Answer::kAsItMay, &C::corrupt},
       {"strangers' frames from the bus", "can1", Answer::kDriveOn, &C::flood},
       {"strangers' frames on the same interface", "can0", Answer::kDriveOn, &C::flood},
       {"lossy wire of the truck", "can1", Answer::kAsItMay, &C::badWire}}};
  int drives = 0;
  std::unique_ptr<Recorder> recorder;
  std::unique_ptr<Truck> truck;
  std::unique_ptr<Pilot> pilot;
  std::minstd_rand engine{seed()};
};

TEST_F(CanMachineCampaign, RandomFaults) {
  constexpr double kSettled = 0.1;     // [s] within which all of a fault is seen
  constexpr int kFaultsOfADrive = 20;  // one recording
  const int many = times(200, 10000);
  for (int i = 0; i < many && !HasFatalFailure(); ++i) {
    if (i % kFaultsOfADrive == 0) begin();
    Kind& kind = kinds[static_cast<std::size_t>(random(static_cast<int>(kinds.size())))];
    SCOPED_TRACE("fault " + std::to_string(i) + ", " + kind.name);
    const bool active = random(4) != 0;  // else into what the one before has left
    if (active) {
      pilot->run(kSettled);
      ASSERT_TRUE(pilot->drive()) << toString(pilot->state()) << ", "
                                  << supervision::toString(pilot->bridge->status().reason) << ", "
                                  << pilot->network->trouble();
    }
    inject(kind, active);
  }
  EXPECT_TRUE(pilot->drive()) << pilot->network->trouble();
  printTable();
}

}  // namespace
}  // namespace tunnel_pilot::bridge
