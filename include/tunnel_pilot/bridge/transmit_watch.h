#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// Knows how long the frames that the bus has taken have been waiting for the proof that they were sent.
/// Frames are sent in sets, at most kMaxSets of which may be on their way: a third is not written, so
/// that whatever happens to the bus, no more than these can come late. With frames every 20 ms, a ceased
/// transmission is found at most 60 ms after it ceased, by ticks of 20 ms and faster. The limit is no
/// multiple of a tick: one that comes a little early would miss it, and find it a tick later.
class TransmitWatch {
 public:
  static constexpr std::size_t kMaxSets = 2;
  static constexpr Stamp kMaxAge = std::chrono::microseconds(34500);

  /// A set of frames was given to the bus at `now`, which took `frames` of them.
  void sent(std::uint64_t frames, Stamp now);

  /// The bus was read and tells how many frames are in flight.
  void update(std::uint64_t in_flight, Stamp now);

  /// As many sets as may be are on their way.
  bool full() const { return count_ == kMaxSets; }

  /// When the bus was last read, the oldest frame in flight was older than kMaxAge.
  bool stalled() const { return stalled_; }

  /// Ages begin anew.
  void forgetTime(Stamp now);

 private:
  struct Set {
    std::uint64_t frames = 0;
    Stamp at{};
  };
  std::array<Set, kMaxSets> sets_{};  ///< on their way, the oldest first
  std::size_t count_ = 0;
  bool stalled_ = false;
};

}  // namespace tunnel_pilot::bridge
