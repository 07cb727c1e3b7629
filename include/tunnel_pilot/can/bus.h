#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tunnel_pilot/can/frame.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::can {

/// State of a bus as its controller tells it (SocketCAN's error states and link).
enum class BusState { kActive, kWarning, kPassive, kBusOff, kDown };

/// A CAN bus seen from one participant. A participant does not receive its own frames (their echo, where
/// a bus has one, is told through `confirmed()`). Non-blocking; never throws after construction.
class Bus {
 public:
  virtual ~Bus() = default;

  /// Time goes on, told each time before the bus is read. Only a bus that has deadlines of its own
  /// listens.
  virtual void tick(Stamp /*now*/) {}

  /// False when the frame was not taken (queue full, link down): it is dropped, never sent late.
  virtual bool send(const Frame& frame) = 0;

  /// Next frame received, if any.
  virtual std::optional<Frame> receive() = 0;

  /// Number of own frames whose transmission is proven (echo on a real bus).
  virtual std::uint64_t confirmed() const = 0;

  /// Number of own frames taken whose fate is still open: they wait, or are being sent. The oldest is
  /// settled first. Where sending is immediate there are none.
  virtual std::uint64_t inFlight() const { return 0; }

  /// Gives up all frames in flight, so that none of them is sent late: from here on state() tells kDown
  /// or kBusOff until the bus is known to be rid of them. Nothing to do where sending is immediate.
  virtual void discard() {}

  virtual BusState state() const = 0;

  /// Why the bus does not work and what an operator must do, in words; empty while nothing is wrong.
  virtual std::string trouble() const { return ""; }

  /// File descriptor that polls readable when frames wait, or -1 where there is none.
  virtual int descriptor() const = 0;
};

}  // namespace tunnel_pilot::can
