#include "tunnel_pilot/can/protection.h"

#include <array>

namespace tunnel_pilot::can {
namespace {

constexpr std::array<std::uint8_t, 256> makeTable() {
  std::array<std::uint8_t, 256> table{};
  for (int i = 0; i < 256; ++i) {
    int value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value & 0x80) != 0 ? (value << 1) ^ 0x2F : value << 1;
    table[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(value & 0xFF);
  }
  return table;
}

constexpr std::array<std::uint8_t, 256> kTable = makeTable();

}  // namespace

std::uint8_t crc8(const std::uint8_t* bytes, std::size_t count) {
  std::uint8_t crc = 0xFF;
  for (std::size_t i = 0; i < count; ++i) crc = kTable[crc ^ bytes[i]];
  return static_cast<std::uint8_t>(crc ^ 0xFF);
}

bool StreamCheck::accept(std::uint8_t counter) {
  const int step = (counter + kCounterModulus - last_) % kCounterModulus;
  const bool right = counter < kCounterModulus && (!started_ || step == 1 || step == 2);
  wrong_ = (wrong_ << 1) | std::bitset<kWindow>(right ? 0 : 1);
  started_ = true;
  last_ = counter;
  return right;
}

void StreamCheck::reject() { wrong_ = (wrong_ << 1) | std::bitset<kWindow>(1); }

}  // namespace tunnel_pilot::can
