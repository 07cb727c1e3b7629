#include "tunnel_pilot/bridge/transmit_watch.h"

#include <algorithm>

namespace tunnel_pilot::bridge {

void TransmitWatch::sent(std::uint64_t frames, Stamp now) {
  if (frames > 0 && !full()) sets_[count_++] = {frames, now};
}

void TransmitWatch::update(std::uint64_t in_flight, Stamp now) {
  std::uint64_t settled = 0;
  for (std::size_t i = 0; i < count_; ++i) settled += sets_[i].frames;
  settled -= std::min(settled, in_flight);
  while (count_ > 0 && settled >= sets_[0].frames) {
    settled -= sets_[0].frames;
    std::move(sets_.begin() + 1, sets_.end(), sets_.begin());
    --count_;
  }
  stalled_ = count_ > 0 && now - sets_[0].at >= kMaxAge;
}

void TransmitWatch::forgetTime(Stamp now) {
  for (Set& set : sets_) set.at = now;
}

}  // namespace tunnel_pilot::bridge
