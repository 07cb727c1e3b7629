#pragma once

#include <ostream>
#include <string>

#include "tunnel_pilot/can/frame.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::can {

/// Writes what is on a bus in the format of `candump -L`, and among it what happened off the bus
/// (docs/can.md, "The log of events"). Times are cut to microseconds and must not decrease. The stream
/// must outlive it.
class LogWriter {
 public:
  explicit LogWriter(std::ostream& out) : out_(out) {}

  void frame(const Frame& frame, Stamp now);
  void event(const std::string& words, Stamp now);

 private:
  std::ostream& out_;
};

/// A frame as `candump -L` writes it: 110#0123456789ABCDEF.
std::string toText(const Frame& frame);

}  // namespace tunnel_pilot::can
