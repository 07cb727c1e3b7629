#include "tunnel_pilot/bridge/truck_link.h"

#include <algorithm>
#include <limits>

namespace tunnel_pilot::bridge {

TruckLink::TruckLink(double timeout) : timeout_(timeout) {}

bool TruckLink::receive(can::Bus& bus, Stamp now) {
  earliest_ = last_call_.value_or(now);
  last_call_ = now;
  new_feedback_ = false;
  foreign_sender_ = false;
  bus.tick(now);
  for (int i = 0; i < kFramesPerTick; ++i) {
    const std::optional<can::Frame> frame = bus.receive();
    if (!frame) break;
    ++frames_received_;
    if (!dispatch(*frame)) ++frames_rejected_;
  }
  return new_feedback_;
}

bool TruckLink::dispatch(const can::Frame& frame) {
  if (frame.extended) return false;
  switch (frame.id) {
    case can::kTruckFeedbackId: {
      const bool taken = take(feedback_, frame);
      new_feedback_ = new_feedback_ || taken;
      return taken;
    }
    case can::kTruckMotionId:
      return take(motion_, frame);
    case can::kTruckStatusId:
      return take(status_, frame);
    case can::kOperatorId:
      return take(operator_, frame);
    case can::kCoils1Id:
      return take(coils1_, frame);
    case can::kCoils2Id:
      return take(coils2_, frame);
    case can::kTpCommandId:
    case can::kTpCommandInfoId:
    case can::kTpStatusId:
      foreign_sender_ = true;
      return false;
    default:
      return false;
  }
}

template <class Fields>
bool TruckLink::take(Stream<Fields>& stream, const can::Frame& frame) {
  const std::optional<Fields> fields = can::decode<Fields>(frame);
  if (!fields) {
    stream.check.reject();
    return false;
  }
  if (!stream.check.accept(fields->counter)) return false;
  stream.latest = *fields;
  stream.received = earliest_;
  return true;
}

void TruckLink::forgetTime() {
  last_call_.reset();
  feedback_.received.reset();
  motion_.received.reset();
  status_.received.reset();
}

double TruckLink::age(Stamp now) const {
  if (!feedback_.received || !motion_.received || !status_.received) {
    return std::numeric_limits<double>::infinity();
  }
  return toSeconds(now - std::min({*feedback_.received, *motion_.received, *status_.received}));
}

bool TruckLink::fresh(Stamp now) const { return age(now) <= timeout_; }

bool TruckLink::corrupt() const {
  return feedback_.check.faulty() || motion_.check.faulty() || status_.check.faulty();
}

}  // namespace tunnel_pilot::bridge
