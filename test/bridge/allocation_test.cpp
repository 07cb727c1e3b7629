// Counts allocations in a program of its own.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../allocations.h"
#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/j1939.h"
#include "tunnel_pilot/can/j1939_bus.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/protection.h"
#include "tunnel_pilot/can/socket_can_bus.h"

namespace tunnel_pilot::bridge {
namespace {

using supervision::Command;
using supervision::Mode;
using supervision::Reason;

constexpr std::uint8_t kPilot = 128, kTruck = 48;  // J1939 addresses

// What is on the wire, without a heap: up to 64 frames or echoes wait for the bridge.
class Wire {
 public:
  void give(can::Received::Kind kind, const can::Frame& frame) {
    waiting_[last_++ % waiting_.size()] = {kind, frame, 0};
  }
  can::Received take() {
    return first_ == last_ ? can::Received() : waiting_[first_++ % waiting_.size()];
  }

  std::uint64_t sent = 0;

 private:
  std::array<can::Received, 64> waiting_{};
  std::size_t first_ = 0, last_ = 0;
};

class FixedBus : public can::Bus {
 public:
  explicit FixedBus(Wire& wire) : wire_(wire) {}
  bool send(const can::Frame&) override { return ++wire_.sent, true; }
  std::optional<can::Frame> receive() override {
    const can::Received received = wire_.take();
    if (received.kind == can::Received::Kind::kNothing) return std::nullopt;
    return received.frame;
  }
  std::uint64_t confirmed() const override { return wire_.sent; }
  can::BusState state() const override { return can::BusState::kActive; }
  int descriptor() const override { return -1; }

 private:
  Wire& wire_;
};

// A kernel that echoes at once.
class FixedSocket : public can::CanSocket {
 public:
  explicit FixedSocket(Wire& wire) : wire_(wire) {}
  int open(const std::vector<can::Identifier>&) override { return 0; }
  void close() override {}
  int send(const can::Frame& frame) override {
    ++wire_.sent;
    wire_.give(can::Received::Kind::kEcho, frame);
    return 0;
  }
  can::Received receive() override { return wire_.take(); }
  can::CanLink link() override {
    can::CanLink link;
    link.present = link.up = link.carrier = link.controller = link.echoes = link.configured = true;
    return link;
  }
  std::optional<can::CanLink> nextChange() override { return std::nullopt; }
  bool startCycle() override { return false; }
  can::LinkCycle cycle() override { return {}; }
  int descriptor() const override { return -1; }

 private:
  Wire& wire_;
};

enum class BusKind { kBare, kSocketCan, kJ1939OnSocketCan };

std::unique_ptr<can::Bus> makeBus(BusKind kind, Wire& wire) {
  if (kind == BusKind::kBare) return std::make_unique<FixedBus>(wire);
  const can::J1939Parameters network{can::Side::kPilot, kPilot, kTruck, 1};
  const bool plain = kind == BusKind::kSocketCan;
  std::vector<can::Identifier> listen;
  for (const can::FrameLayout& layout : can::frameLayouts()) listen.push_back({layout.id, false});
  auto bus = std::make_unique<can::SocketCanBus>("can0", plain ? listen : can::j1939Identifiers(network),
                                                 std::make_unique<FixedSocket>(wire));
  if (plain) return bus;
  return std::make_unique<can::J1939Bus>(network, std::move(bus));
}

// A truck that obeys at once, an arbiter, and the bridge between them, all without a heap of their own.
struct Drive {
  explicit Drive(BusKind on) : kind(on), bus(makeBus(on, wire)) {
    feedback.operator_enable = feedback.autonomy_enabled = true;
    status.operator_key = true;
    command.speed = 3.0;
    command.acceleration = 0.8;
    command.mode = Mode::kAutonomous;
  }

  static std::string file(const std::string& name) {
    return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name;
  }

  // 20 ms: the truck's frames, the arbiter's command, four ticks.
  void cycle() {
    counter = can::nextCounter(counter);
    feedback.counter = motion.counter = status.counter = counter;
    say(*can::encode(feedback));
    say(*can::encode(motion));
    say(*can::encode(status));
    if (arbiter_alive) {
      command.stamp = now - std::chrono::milliseconds(60);
      ++command.sequence;
      bridge.setCommand(command, now);
    }
    for (int i = 0; i < 4; ++i) {
      now += std::chrono::milliseconds(5);
      bridge.tick(now);
    }
  }

  // So many cycles of steering to and fro; the truck follows its command.
  void cycles(int count) {
    for (int i = 0; i < count; ++i) {
      command.articulation_angle = 0.1 * std::sin(0.02 * ++steps);
      feedback.articulation_angle = command.articulation_angle;
      feedback.speed = motion.front_axle_speed = motion.rear_axle_speed = speed;
      cycle();
    }
  }

  // As the truck, on this bus.
  void say(can::Frame frame) {
    if (kind == BusKind::kJ1939OnSocketCan) {
      for (const can::J1939Group& group : can::j1939Groups()) {
        if (group.id != frame.id) continue;
        frame.id = can::toIdentifier({group.priority, group.pgn, can::kGlobalAddress, kTruck});
        frame.extended = true;
        break;
      }
    }
    wire.give(can::Received::Kind::kFrame, frame);
  }

  BusKind kind;
  Wire wire;
  std::unique_ptr<can::Bus> bus;
  CanBridge bridge{loadBridge(config::loadFile(file("can_bridge.yaml"))),
                   vehicle::loadTruck(file("truck.yaml")).geometry, *bus};
  can::TruckFeedbackFrame feedback;
  can::TruckMotionFrame motion;
  can::TruckStatusFrame status;
  Command command;
  Stamp now = std::chrono::seconds(100);
  std::uint8_t counter = 0;
  int steps = 0;
  double speed = 0.0;
  bool arbiter_alive = true;
};

// Armed: engaged by an operator, not yet driving.
struct BridgeAllocation : testing::TestWithParam<BusKind> {
  void SetUp() override {
    SKIP_WHERE_ALLOCATIONS_ARE_NOT_COUNTED();
    ASSERT_EQ(allocationsOfOne(), 1);
    drive.cycles(80);
    ASSERT_TRUE(drive.bridge.engage(drive.now).accepted);
    ASSERT_EQ(state(), SafetyState::kArmed);
  }
  SafetyState state() const { return drive.bridge.status().state; }
  void getUnderWay() {
    drive.cycles(20);
    drive.speed = 3.0;
    drive.cycles(20);
    ASSERT_EQ(state(), SafetyState::kActive);
  }

  Drive drive{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Buses, BridgeAllocation,
                         testing::Values(BusKind::kBare, BusKind::kSocketCan,
                                         BusKind::kJ1939OnSocketCan));

TEST_P(BridgeAllocation, NoneFromArmedOnWhileItDrives) {
  EXPECT_EQ(allocationsOf([&] {
              getUnderWay();
              drive.cycles(3000);
            }),
            0);
  EXPECT_EQ(state(), SafetyState::kActive);
}

TEST_P(BridgeAllocation, NoneWhenItDegradesAndRecovers) {
  getUnderWay();
  EXPECT_EQ(allocationsOf([&] {
              drive.command.reason = Reason::kLowConfidence;
              drive.cycles(20);
              EXPECT_EQ(state(), SafetyState::kDegraded);
              drive.command.reason = Reason::kNone;
              drive.cycles(100);
            }),
            0);
  EXPECT_EQ(state(), SafetyState::kActive);
}

TEST_P(BridgeAllocation, NoneInAStopWithoutAnArbiter) {
  getUnderWay();
  EXPECT_EQ(allocationsOf([&] {
              drive.arbiter_alive = false;
              drive.cycles(20);
              EXPECT_EQ(state(), SafetyState::kStopping);
              drive.speed = 0.0;
              drive.cycles(100);
            }),
            0);
  EXPECT_EQ(state(), SafetyState::kStopped);
}

TEST_P(BridgeAllocation, NoneForCommandsThatAreRefused) {
  getUnderWay();
  Command bad = drive.command;
  EXPECT_EQ(allocationsOf([&] {
              for (int i = 0; i < 20; ++i) {
                bad.articulation_angle = std::numeric_limits<double>::quiet_NaN();
                drive.bridge.setCommand(bad, drive.now);
                drive.cycles(1);
              }
            }),
            0);
  EXPECT_EQ(drive.bridge.status().commands_rejected, 20u);
}

TEST_P(BridgeAllocation, NoneForFramesThatAreCorrupt) {
  getUnderWay();
  EXPECT_EQ(allocationsOf([&] {
              can::Frame corrupt = *can::encode(drive.feedback);
              corrupt.data[3] ^= 0x10;
              for (int i = 0; i < 5; ++i) {
                drive.say(corrupt);
                drive.cycles(1);
              }
            }),
            0);
  EXPECT_EQ(state(), SafetyState::kStopping);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
