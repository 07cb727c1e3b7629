#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/can_socket.h"

namespace tunnel_pilot::can {

/// A real bus through Linux' SocketCAN, on an interface whose bit rate somebody else has set
/// (docs/can.md says how). Only the identifiers it listens to come through, which must contain the own
/// ones: one of those that this bus did not send is received like any other frame.
///
/// A frame counts as sent when the driver echoes it. A frame that cannot be sent at once is refused, and
/// what is in flight when the bus fails is never forgotten: until the link has been down (which empties
/// all its queues) nothing more is written. discard() asks the helper program for that; where it is not
/// installed, trouble() asks an operator. An interface that vanishes is opened anew when it is back. An
/// interface may be absent, down or bus-off from the start.
///
/// The kernel must not restart a bus-off controller by itself (restart-ms 0): it would send what waited.
/// An interface that does so is not used.
class SocketCanBus : public Bus {
 public:
  SocketCanBus(std::string interface, std::vector<Identifier> listen, std::unique_ptr<CanSocket> socket);

  bool send(const Frame& frame) override;

  /// Also takes in echoes, error frames and changes of the link: call it until it gives nothing.
  std::optional<Frame> receive() override;

  std::uint64_t confirmed() const override { return confirmed_; }
  std::uint64_t inFlight() const override { return in_flight_; }
  void discard() override;
  BusState state() const override;
  std::string trouble() const override;
  int descriptor() const override { return socket_->descriptor(); }

  /// Frames received that are not on the list, remote or otherwise odd, and discarded.
  std::uint64_t discarded() const { return discarded_; }

  /// Echoes of frames that were given up: sent late, before the link was emptied of them.
  std::uint64_t late() const { return late_; }

 private:
  bool listensTo(const Frame& frame) const;
  std::optional<Frame> take(const Received& received);
  void takeEcho();
  void takeErrorFrame(const Frame& frame);
  void takeError(int error);
  void takeLink(const CanLink& link);
  void takeCycle();
  void watchLink();
  void emptied();
  bool usable() const;

  std::string interface_;
  std::vector<Identifier> listen_;
  std::unique_ptr<CanSocket> socket_;
  CanLink link_;
  bool open_ = false;
  int open_error_ = 0;        ///< errno
  bool bus_off_ = false;      ///< until the link has been down
  bool stuck_ = false;        ///< likewise: the controller or its queue does not take frames
  bool discarding_ = false;   ///< likewise
  bool interrupted_ = false;  ///< the link was down since the bus was last read
  bool read_out_ = false;     ///< the last receive() gave nothing
  std::string helper_failed_;
  std::uint64_t confirmed_ = 0;
  std::uint64_t in_flight_ = 0;
  std::uint64_t discarded_ = 0;
  std::uint64_t late_ = 0;
};

}  // namespace tunnel_pilot::can
