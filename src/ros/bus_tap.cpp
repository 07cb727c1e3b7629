#include "tunnel_pilot/ros/bus_tap.h"

#include <poll.h>

namespace tunnel_pilot::shell {

std::optional<can::Frame> BusTap::receive() {
  count();
  if (waiting_.empty()) return std::nullopt;
  const can::Frame frame = waiting_.front();
  waiting_.pop_front();
  return frame;
}

std::uint64_t BusTap::count() {
  while (const auto frame = bus_->receive()) {
    if (frame->id == counted_ && !frame->extended) {
      ++count_;
      newest_ = *frame;
    }
    if (waiting_.size() < kQueueLength) waiting_.push_back(*frame);
  }
  return count_;
}

void BusTap::wait(int milliseconds) const {
  pollfd entry{bus_->descriptor(), POLLIN, 0};
  ::poll(&entry, 1, milliseconds);
}

}  // namespace tunnel_pilot::shell
