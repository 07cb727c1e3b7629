#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>

namespace tunnel_pilot::can {

/// CRC-8 with polynomial 0x2F, initial value 0xFF and final XOR 0xFF (AUTOSAR's CRC8H2F; over
/// "123456789" it is 0xDF). On 64 bits it finds every error of up to three bits.
std::uint8_t crc8(const std::uint8_t* bytes, std::size_t count);

/// Alive counters run 0, 1, ... 14, 0, ... (AUTOSAR E2E profile 1); 15 is never sent.
constexpr std::uint8_t kCounterModulus = 15;

constexpr std::uint8_t nextCounter(std::uint8_t counter) {
  return static_cast<std::uint8_t>((counter + 1) % kCounterModulus);
}

/// Judges the stream of frames of one identifier. A frame's counter must be one or two ahead of the
/// frame before (one lost frame is forgiven). The last ten receptions are kept: while three or more of
/// them were wrong (CRC, length or counter), the stream is faulty.
class StreamCheck {
 public:
  /// Takes the counter of a frame whose CRC is right. False: the frame is to be discarded. After a wrong
  /// step the stream is followed from the new counter, so that a restarted sender costs one frame.
  bool accept(std::uint8_t counter);

  /// Records a frame that could not be decoded.
  void reject();

  bool faulty() const { return wrong_.count() >= kFaultCount; }

  void reset() { *this = StreamCheck(); }

 private:
  static constexpr std::size_t kWindow = 10;
  static constexpr std::size_t kFaultCount = 3;

  std::bitset<kWindow> wrong_;
  std::uint8_t last_ = 0;
  bool started_ = false;
};

}  // namespace tunnel_pilot::can
