#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rig.h"
#include "tunnel_pilot/can/bus.h"

namespace tunnel_pilot::bridge {

/// A wire that may keep back the proof that frames were sent, or take of each set the command alone, and
/// counts how often it is asked to discard frames.
class HoldingBus : public can::Bus {
 public:
  explicit HoldingBus(can::Bus& wire) : wire_(wire) {}

  void hold() { holds_ = true; }
  void prove() {
    holds_ = false;
    in_flight_ = 0;
  }
  void takeCommandsOnly(bool only) { commands_only_ = only; }
  int discards() const { return discards_; }

  bool send(const can::Frame& frame) override {
    if (commands_only_ && frame.id != can::kTpCommandId) return false;
    const bool taken = wire_.send(frame);
    if (taken && holds_) ++in_flight_;
    return taken;
  }
  std::optional<can::Frame> receive() override { return wire_.receive(); }
  std::uint64_t confirmed() const override { return wire_.confirmed() - in_flight_; }
  std::uint64_t inFlight() const override { return in_flight_; }
  void discard() override { ++discards_; }
  can::BusState state() const override { return wire_.state(); }
  int descriptor() const override { return -1; }

 private:
  can::Bus& wire_;
  bool holds_ = false;
  bool commands_only_ = false;
  std::uint64_t in_flight_ = 0;
  int discards_ = 0;
};

/// A rig whose bridge has such a wire; at the end no frame was unsafe.
class HoldingBusTest : public testing::Test {
 protected:
  /// `tick` [s]: how often the bridge is called
  explicit HoldingBusTest(double tick)
      : rig(tick, [this](can::Bus& wire) {
          auto made = std::make_unique<HoldingBus>(wire);
          bus = made.get();
          return made;
        }) {}
  void TearDown() override {
    for (const std::string& complaint : rig.judge.complaints)
      ADD_FAILURE() << "unsafe frame: " << complaint;
  }

  HoldingBus* bus = nullptr;
  Rig rig;
};

}  // namespace tunnel_pilot::bridge
