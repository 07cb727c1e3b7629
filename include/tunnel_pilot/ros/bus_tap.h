#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "tunnel_pilot/can/bus.h"

namespace tunnel_pilot::shell {

/// A bus whose incoming frames can be counted before their reader takes them: how the simulator in
/// lockstep sees that the bridge has spoken, and what it knew. At most kQueueLength frames wait; what
/// comes then is lost.
class BusTap : public can::Bus {
 public:
  static constexpr std::size_t kQueueLength = 4096;

  /// `counted` is the identifier to count.
  BusTap(std::unique_ptr<can::Bus> bus, std::uint32_t counted)
      : bus_(std::move(bus)), counted_(counted) {}

  void tick(Stamp now) override { bus_->tick(now); }
  bool send(const can::Frame& frame) override { return bus_->send(frame); }
  std::optional<can::Frame> receive() override;
  std::uint64_t confirmed() const override { return bus_->confirmed(); }
  std::uint64_t inFlight() const override { return bus_->inFlight(); }
  void discard() override { bus_->discard(); }
  can::BusState state() const override { return bus_->state(); }
  std::string trouble() const override { return bus_->trouble(); }
  int descriptor() const override { return bus_->descriptor(); }

  /// Takes in what waits on the bus, and returns how many counted frames have come since the start.
  std::uint64_t count();

  /// The counted frame that came last.
  const can::Frame& newest() const { return newest_; }

  /// Sleeps until something waits on the bus, at most `milliseconds` of steady time.
  void wait(int milliseconds) const;

 private:
  std::unique_ptr<can::Bus> bus_;
  std::uint32_t counted_;
  std::deque<can::Frame> waiting_;
  std::uint64_t count_ = 0;
  can::Frame newest_;
};

}  // namespace tunnel_pilot::shell
