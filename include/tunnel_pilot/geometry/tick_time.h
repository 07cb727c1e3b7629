#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot {

/// Time that passed for something called again and again, when its clock may jump: a step back counts as
/// none, any other as no longer than the longest of the kSteps before it, nor than kLongest. So a jump
/// hastens nothing that is called in a steady rhythm, and a call that comes late delays. Begins at zero,
/// with a step that counts as none.
class TickTime {
 public:
  static constexpr std::size_t kSteps = 8;
  static constexpr Stamp kLongest = std::chrono::milliseconds(25);

  void tick(Stamp now) {
    const Stamp step = std::clamp(now - last_.value_or(now), Stamp::zero(), kLongest);
    last_ = now;
    time_ += std::min(step, *std::max_element(steps_.begin(), steps_.end()));
    steps_[oldest_++ % kSteps] = step;
  }

  Stamp now() const { return time_; }

 private:
  std::optional<Stamp> last_;          // by the clock
  std::array<Stamp, kSteps> steps_{};  // likewise
  std::size_t oldest_ = 0;
  Stamp time_{};
};

}  // namespace tunnel_pilot
