#include "tunnel_pilot/bridge/command_sender.h"

#include <algorithm>
#include <optional>

#include "tunnel_pilot/can/protection.h"

namespace tunnel_pilot::bridge {

CommandSender::CommandSender(double period) : period_(fromSeconds(period)) {}

void CommandSender::pass(Stamp now) {
  counted_ += std::clamp(now - passed_at_, Stamp::zero(), kLongestTick);
  passed_at_ = now;
}

void CommandSender::forgetTime(Stamp now) {
  started_ = false;
  passed_at_ = now;
}

bool CommandSender::due(bool stop, Stamp now) const {
  return !started_ || now >= next_ - kEarly || (stop && !stop_told_);
}

bool CommandSender::withinRate() const {
  if (sets_sent_ < kMaxFrames) return true;
  return counted_ - sent_at_[sets_sent_ % kMaxFrames] > kWindow;  // the oldest of the ring
}

template <class Fields>
bool CommandSender::sendOne(const Fields& fields, can::Bus& bus) {
  const std::optional<can::Frame> frame = can::encode(fields);
  if (!frame || !bus.send(*frame)) return false;
  ++frames_sent_;
  return true;
}

bool CommandSender::send(can::TruckCommandFrame command, can::CommandInfoFrame info,
                         can::BridgeStatusFrame status, can::Bus& bus, Stamp now) {
  pass(now);
  if (!withinRate()) {
    ++sets_blocked_;
    return false;
  }
  // In step with the period, but after a gap nothing is made up for.
  const bool in_step = started_ && now >= next_ - kEarly && now < next_ + period_;
  next_ = (in_step ? next_ : now) + period_;
  started_ = true;
  command.counter = info.counter = status.counter = counter_ = can::nextCounter(counter_);
  sent_at_[sets_sent_++ % kMaxFrames] = counted_;
  stop_told_ = command.stop;
  const bool command_sent = sendOne(command, bus);
  refused_in_row_ = command_sent ? 0 : refused_in_row_ + 1;
  if (command_sent && sendOne(info, bus) && sendOne(status, bus)) {
    failed_in_row_ = 0;
  } else {
    ++failed_in_row_;
    ++sets_failed_;
  }
  return true;
}

}  // namespace tunnel_pilot::bridge
