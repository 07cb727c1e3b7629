#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/frame.h"

namespace tunnel_pilot::can {

/// An identifier to listen to, or all that agree with it in the bits of a mask.
struct Identifier {
  std::uint32_t id = 0;             ///< 11 or 29 bits, without flags
  bool extended = false;            ///< 29-bit identifier
  std::uint32_t mask = 0x1FFFFFFF;  ///< bits that count; of 11-bit identifiers always all
};

/// True when a frame's identifier is one of those.
bool matches(const Identifier& identifier, const Frame& frame);

/// A CAN interface as rtnetlink tells of it.
struct CanLink {
  bool present = false;
  bool up = false;                     ///< set up by an operator (IFF_UP)
  bool carrier = false;                ///< a controller has it while it is not bus-off
  bool controller = false;             ///< hardware; false: virtual, without error states
  bool echoes = false;                 ///< the driver echoes what was sent, not what was asked for
  bool configured = false;             ///< has a bit rate
  std::uint32_t restart_ms = 0;        ///< the kernel restarts a bus-off controller by itself [ms]
  BusState state = BusState::kActive;  ///< of the controller
};

/// What came out of the socket.
struct Received {
  enum class Kind { kFrame, kEcho, kErrorFrame, kOther, kNothing, kError };
  Kind kind = Kind::kNothing;
  Frame frame;    ///< of an error frame: its class as the identifier
  int error = 0;  ///< errno, of kError
};

/// How far the cycle of the link (down and up) is.
struct LinkCycle {
  enum class Stage { kNone, kRunning, kDone, kFailed };
  Stage stage = Stage::kNone;
  std::string why;  ///< it failed
};

/// The kernel behind SocketCanBus: a raw CAN socket, rtnetlink and the helper program that cycles the
/// link, for one interface. Nothing blocks (but for the kernel's own lock of its links) and nothing
/// throws; errors are errno values, 0 is success.
class CanSocket {
 public:
  virtual ~CanSocket() = default;

  /// Opens the interface for the frames of `listen`, own echoes and error frames; an open one is closed.
  virtual int open(const std::vector<Identifier>& listen) = 0;
  virtual void close() = 0;
  virtual int send(const Frame& frame) = 0;
  virtual Received receive() = 0;

  /// The interface now.
  virtual CanLink link() = 0;

  /// The next change of the interface that was not told yet, in the order they happened.
  virtual std::optional<CanLink> nextChange() = 0;

  /// Starts the helper. False: it cannot be started; `cycle()` says why.
  virtual bool startCycle() = 0;

  /// What became of the last start; kDone and kFailed are told once.
  virtual LinkCycle cycle() = 0;

  virtual int descriptor() const = 0;
};

/// The real one. `helper` is the path of the program can_link_cycle. Throws std::invalid_argument for a
/// name that cannot be an interface's, std::runtime_error for a kernel without CAN or rtnetlink.
std::unique_ptr<CanSocket> openCanSocket(const std::string& interface, const std::string& helper);

}  // namespace tunnel_pilot::can
