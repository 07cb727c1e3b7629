#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <vector>

#include "tunnel_pilot/can/bus.h"

namespace tunnel_pilot::can {

/// A bus within one process and thread: every frame reaches every other participant at once and in the
/// order it was sent, so that a run is the same each time. The state of the bus can be set to rehearse
/// faults. A participant's queue holds kQueueLength frames; what comes while it is full is lost for it.
class MemoryBusHub {
 public:
  static constexpr std::size_t kQueueLength = 4096;

  MemoryBusHub();
  ~MemoryBusHub();

  /// A new participant. It may outlive the hub; it then has nobody to talk to.
  std::unique_ptr<Bus> connect();

  /// State that every participant sees. While it is bus-off or down nothing is sent.
  void setState(BusState state);

  /// Frames lost to full queues so far.
  std::size_t dropped() const;

  struct Wire;  ///< shared by the hub and its participants; defined in the source

 private:
  std::shared_ptr<Wire> wire_;
};

}  // namespace tunnel_pilot::can
