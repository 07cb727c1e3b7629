// Random faults of the kernel's CAN, one after the other and into each other, in whatever state the
// bridge is. It must never be armed by itself, and be fit to drive again after each. The monitor of
// test/bus_monitor cannot judge these logs: the emulated bus takes no time, and its controllers lose and
// hold up frames when many come at once.
#include <gtest/gtest.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <random>

#include "options.h"
#include "rig.h"
#include "tunnel_pilot/can/layout.h"

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

class CanMachineCampaign : public testing::Test {
 protected:
  using Fault = std::function<void()>;
  struct Kind {
    const char* name;
    void (CanMachineCampaign::*provoke)();
    int count;
  };

  CanMachineCampaign() { cleanLinks(); }

  double random(double low, double high) { return std::uniform_real_distribution<>(low, high)(engine); }
  int random(int below) { return static_cast<int>(engine() % static_cast<unsigned>(below)); }
  std::string either() { return random(2) == 0 ? "can0" : "can1"; }

  /// Has it happen beside the bridge, which goes on meanwhile.
  void inject(const Fault& fault) {
    const Injection injection(fault);
    ASSERT_TRUE(pilot.run(10.0, [&] { return injection.done(); }));
  }

  can_frame frameOf(std::uint32_t id) {
    can_frame frame{};
    frame.can_id = id;
    frame.can_dlc = 8;
    for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(engine());
    return frame;
  }
  void say(const std::string& interface, const std::vector<can_frame>& frames) {
    inject([&] {
      const Stranger stranger(interface);
      for (const can_frame& frame : frames) stranger.say(frame);
    });
  }

  // -------- the faults

  void busOff() {
    inject([word = either()] { provoke("bus_off", word); });
  }
  void stall() {
    inject([word = either()] { provoke("stop_queue", word); });
  }
  void lateFrames() {
    inject([interface = either(), seconds = random(0.001, 0.1)] {
      provoke("stop_queue", interface);
      wait(seconds);
      provoke("wake_queue", interface);
    });
  }
  void hang() {
    inject([] { hangController("can0"); });
  }
  void linkDown() {
    inject([interface = either(), seconds = random(0.0, 0.1)] {
      setLink(interface, false);
      wait(seconds);
      setLink(interface, true);
    });
  }
  void timeout() {
    inject([word = either()] { provoke("timeout", word); });
  }
  void errorState() {
    static const std::array<const char*, 3> kWords{"warning", "passive", "active"};
    inject([word = kWords[static_cast<std::size_t>(random(3))], interface = either()] {
      provoke(word, interface);
    });
  }
  void foreign() {
    static const std::array<std::uint32_t, 3> kIds{can::kTpCommandId, can::kTpCommandInfoId,
                                                   can::kTpStatusId};
    const can_frame frame = frameOf(kIds[static_cast<std::size_t>(random(3))]);
    say(either(), {frame});
  }
  void corrupt() {
    std::vector<can_frame> frames;
    for (int i = random(5); i >= 0; --i) {
      can_frame frame = frameOf(static_cast<std::uint32_t>(can::kTruckFeedbackId + random(6)));
      if (random(3) == 0) frame.can_dlc = static_cast<__u8>(random(8));
      if (random(4) == 0) frame.can_id |= CAN_RTR_FLAG;
      frames.push_back(frame);
    }
    say("can1", frames);
  }
  void flood() {
    std::vector<can_frame> frames;
    for (int i = random(100); i >= 0; --i) {
      const bool is_long = random(2) == 0;
      frames.push_back(frameOf(is_long
                                   ? static_cast<std::uint32_t>(engine() & CAN_EFF_MASK) | CAN_EFF_FLAG
                                   : static_cast<std::uint32_t>(0x200 + random(0x600))));
    }
    say(either(), frames);
  }
  void badWire() {
    static const std::array<const char*, 5> kHow{"loss 30%", "delay 20ms 20ms", "duplicate 30%",
                                                 "corrupt 30%", "delay 10ms reorder 50%"};
    inject([how = std::string(kHow[static_cast<std::size_t>(random(5))]), seconds = random(0.02, 0.3)] {
      tunnel_pilot::bridge::run("/sbin/tc qdisc replace dev can1 root netem limit 10 " + how);
      wait(seconds);
      tunnel_pilot::bridge::run("/sbin/tc qdisc del dev can1 root");
    });
  }

  std::array<Kind, 11> kinds{{{"bus-off", &CanMachineCampaign::busOff, 0},
                              {"stalled queue", &CanMachineCampaign::stall, 0},
                              {"late frames", &CanMachineCampaign::lateFrames, 0},
                              {"hung controller", &CanMachineCampaign::hang, 0},
                              {"link down and up", &CanMachineCampaign::linkDown, 0},
                              {"timeout told", &CanMachineCampaign::timeout, 0},
                              {"error state told", &CanMachineCampaign::errorState, 0},
                              {"foreign frame", &CanMachineCampaign::foreign, 0},
                              {"corrupt frames of the truck", &CanMachineCampaign::corrupt, 0},
                              {"strangers' frames", &CanMachineCampaign::flood, 0},
                              {"lossy wire of the truck", &CanMachineCampaign::badWire, 0}}};
  Truck truck;
  Pilot pilot;
  std::minstd_rand engine{seed()};
};

// Not run: after some 30 faults one side hears nothing any more, which a cycle of the links does not
// cure. The fault may be the emulated controller's (its queue of received frames after an overrun, by
// the flood); that is not shown yet.
TEST_F(CanMachineCampaign, DISABLED_RandomFaults) {
  const int many = times(200, 10000);
  int driving = 0;
  for (int i = 0; i < many && !HasFatalFailure(); ++i) {
    if (random(3) != 0) {
      ASSERT_TRUE(pilot.drive()) << i << ": " << toString(pilot.state()) << ", "
                                 << supervision::toString(pilot.bridge->status().reason) << ", "
                                 << pilot.network->trouble();
    }
    pilot.run(random(0.0, 0.05));
    if (pilot.state() == SafetyState::kActive) ++driving;
    Kind& kind = kinds[static_cast<std::size_t>(random(static_cast<int>(kinds.size())))];
    ++kind.count;
    (this->*kind.provoke)();
    pilot.run(random(0.0, 0.2));
    EXPECT_FALSE(pilot.armed_by_itself) << "after fault " << i << ", " << kind.name;
  }
  EXPECT_TRUE(pilot.drive()) << pilot.network->trouble();
  std::string list;
  for (const Kind& kind : kinds) list += ", " + std::to_string(kind.count) + " " + kind.name;
  std::printf("TABLE random faults: %d, %d of them while ACTIVE%s\n", many, driving, list.c_str());
}

}  // namespace
}  // namespace tunnel_pilot::bridge
