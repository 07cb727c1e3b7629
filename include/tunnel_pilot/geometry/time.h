#pragma once

#include <chrono>
#include <cmath>

namespace tunnel_pilot {

/// A point in time or a duration [ns], counted from the clock's own zero. Integer, so that a scan's
/// stamp survives every conversion unchanged and may be compared for equality. The core never reads a
/// clock: time is always an argument.
using Stamp = std::chrono::nanoseconds;

/// Duration in seconds [s].
inline double toSeconds(Stamp stamp) { return std::chrono::duration<double>(stamp).count(); }

/// Nearest nanosecond to `seconds` [s].
inline Stamp fromSeconds(double seconds) { return Stamp(std::llround(seconds * 1e9)); }

}  // namespace tunnel_pilot
