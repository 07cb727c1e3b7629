// Counts allocations in a program of its own.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "../allocations.h"
#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/protection.h"

namespace tunnel_pilot::bridge {
namespace {

using supervision::Command;
using supervision::Mode;
using supervision::Reason;

// A bus without a heap: up to 64 frames wait for the bridge.
class FixedBus : public can::Bus {
 public:
  bool send(const can::Frame& frame) override {
    sent_ = frame;
    ++confirmed_;
    return true;
  }
  std::optional<can::Frame> receive() override {
    if (first_ == last_) return std::nullopt;
    return waiting_[first_++ % waiting_.size()];
  }
  std::uint64_t confirmed() const override { return confirmed_; }
  can::BusState state() const override { return can::BusState::kActive; }
  int descriptor() const override { return -1; }

  void give(const std::optional<can::Frame>& frame) { waiting_[last_++ % waiting_.size()] = *frame; }

 private:
  std::array<can::Frame, 64> waiting_{};
  std::size_t first_ = 0, last_ = 0;
  can::Frame sent_;
  std::uint64_t confirmed_ = 0;
};

// A truck that obeys at once, an arbiter, and the bridge between them, all without a heap of their own.
struct Drive {
  static std::string file(const std::string& name) {
    return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name;
  }

  // 20 ms: the truck's frames, the arbiter's command, four ticks.
  void cycle() {
    counter = can::nextCounter(counter);
    feedback.counter = motion.counter = status.counter = counter;
    bus.give(can::encode(feedback));
    bus.give(can::encode(motion));
    bus.give(can::encode(status));
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

  Drive() {
    feedback.operator_enable = feedback.autonomy_enabled = true;
    status.operator_key = true;
    command.speed = 3.0;
    command.acceleration = 0.8;
    command.mode = Mode::kAutonomous;
  }

  FixedBus bus;
  CanBridge bridge{loadBridge(config::loadFile(file("can_bridge.yaml"))),
                   vehicle::loadTruck(file("truck.yaml")).geometry, bus};
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
struct BridgeAllocation : testing::Test {
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

  Drive drive;
};

TEST_F(BridgeAllocation, NoneFromArmedOnWhileItDrives) {
  EXPECT_EQ(allocationsOf([&] {
              getUnderWay();
              drive.cycles(3000);
            }),
            0);
  EXPECT_EQ(state(), SafetyState::kActive);
}

TEST_F(BridgeAllocation, NoneWhenItDegradesAndRecovers) {
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

TEST_F(BridgeAllocation, NoneInAStopWithoutAnArbiter) {
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

TEST_F(BridgeAllocation, NoneForCommandsThatAreRefused) {
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

TEST_F(BridgeAllocation, NoneForFramesThatAreCorrupt) {
  getUnderWay();
  EXPECT_EQ(allocationsOf([&] {
              can::Frame corrupt = *can::encode(drive.feedback);
              corrupt.data[3] ^= 0x10;
              for (int i = 0; i < 5; ++i) {
                drive.bus.give(corrupt);
                drive.cycles(1);
              }
            }),
            0);
  EXPECT_EQ(state(), SafetyState::kStopping);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
