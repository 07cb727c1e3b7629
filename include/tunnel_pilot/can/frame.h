#pragma once

#include <array>
#include <cstdint>

namespace tunnel_pilot::can {

/// One classic CAN frame. Its fields are those of Linux' struct can_frame, without its kernel header.
struct Frame {
  std::uint32_t id = 0;   ///< 11 or 29 bits, without flags
  bool extended = false;  ///< 29-bit identifier
  std::uint8_t length = 0;
  std::array<std::uint8_t, 8> data{};
};

}  // namespace tunnel_pilot::can
