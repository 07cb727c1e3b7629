#include "tunnel_pilot/can/linux_frame.h"

#include <cstring>

namespace tunnel_pilot::can {

can_frame toLinux(const Frame& frame) {
  can_frame out{};
  out.can_id = frame.extended ? (frame.id & CAN_EFF_MASK) | CAN_EFF_FLAG : frame.id & CAN_SFF_MASK;
  out.can_dlc = frame.length;
  std::memcpy(out.data, frame.data.data(), frame.data.size());
  return out;
}

std::optional<Frame> fromLinux(const can_frame& in) {
  if ((in.can_id & (CAN_RTR_FLAG | CAN_ERR_FLAG)) != 0 || in.can_dlc > CAN_MAX_DLEN) return std::nullopt;
  Frame frame;
  frame.extended = (in.can_id & CAN_EFF_FLAG) != 0;
  frame.id = in.can_id & CAN_EFF_MASK;
  if (!frame.extended && frame.id > CAN_SFF_MASK) return std::nullopt;
  frame.length = in.can_dlc;
  std::memcpy(frame.data.data(), in.data, frame.length);
  return frame;
}

}  // namespace tunnel_pilot::can
