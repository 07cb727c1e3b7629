#pragma once

#include <algorithm>
#include <optional>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot {

/// Time that passed for something called in a steady rhythm, when its clock may jump: a step back counts
/// as none, any other as no longer than the last one ahead, the first as none. So a jump hastens
/// nothing, and a call that comes late delays. Begins at zero.
class TickTime {
 public:
  void tick(Stamp now) {
    if (last_) {
      const Stamp step = std::max(now - *last_, Stamp::zero());
      time_ += std::min(step, step_);
      if (step > Stamp::zero()) step_ = step;
    }
    last_ = now;
  }

  Stamp now() const { return time_; }

 private:
  std::optional<Stamp> last_;  // by the clock
  Stamp step_{}, time_{};
};

}  // namespace tunnel_pilot
