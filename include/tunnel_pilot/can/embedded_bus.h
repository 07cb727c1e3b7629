#pragma once

#include <cstdint>
#include <string>

#include "tunnel_pilot/can/bus.h"

namespace tunnel_pilot::can {

/// A bus between the processes of one machine that needs no CAN in the kernel: local datagrams, each of
/// them one `struct can_frame` of Linux (16 bytes, host byte order). Every participant owns one socket
/// file in the bus's folder and sends to all the others, so any language can join or listen
/// (docs/can.md). Full queues lose frames as a controller's do, and are counted.
///
/// Folder: $XDG_RUNTIME_DIR/tunnel_pilot_can/NAME, or /tmp/tunnel_pilot_can.UID/NAME, for its owner
/// only. The kernel keeps few datagrams for a socket (net.unix.max_dgram_qlen, often 10): read at least
/// every 20 ms, or when descriptor() polls readable. Throws std::invalid_argument for a name that is not
/// 1 to 32 of [A-Za-z0-9_-], std::runtime_error when the folder or the socket cannot be made.
class EmbeddedBus : public Bus {
 public:
  explicit EmbeddedBus(const std::string& name);
  ~EmbeddedBus() override;
  EmbeddedBus(const EmbeddedBus&) = delete;
  EmbeddedBus& operator=(const EmbeddedBus&) = delete;

  bool send(const Frame& frame) override;
  std::optional<Frame> receive() override;
  std::uint64_t confirmed() const override { return confirmed_; }
  BusState state() const override;
  int descriptor() const override { return socket_; }

  /// Frames that some receiver's full queue has lost.
  std::uint64_t dropped() const { return dropped_; }

  /// Datagrams received that are not a data frame, and discarded.
  std::uint64_t malformed() const { return malformed_; }

  const std::string& folder() const { return folder_; }

 private:
  void removeStaleSockets();
  void sendTo(const std::string& path, const void* bytes, std::size_t count);

  std::string folder_;
  std::string path_;  ///< own socket file
  int socket_ = -1;
  std::uint64_t confirmed_ = 0;
  std::uint64_t dropped_ = 0;
  std::uint64_t malformed_ = 0;
};

}  // namespace tunnel_pilot::can
