#pragma once

#include <cstdint>
#include <vector>

namespace tunnel_pilot::can {

/// Where a signal stands in its frame and what its raw number means: a mirror of one SG_ line of
/// config/tunnel_pilot.dbc, which is the source of truth (a test compares them number by number).
/// All signals are little-endian (Intel) and have no offset.
struct SignalLayout {
  const char* name;
  int start;   ///< lowest bit, byte * 8 + bit [1]
  int length;  ///< [bit]
  bool is_signed;
  double factor;     ///< physical value in `unit` of one raw step
  double min;        ///< [unit]
  double max;        ///< [unit]
  const char* unit;  ///< as on the wire: "deg", "kPa", ...
};

/// A mirror of one BO_ with its attributes.
struct FrameLayout {
  std::uint32_t id;
  const char* name;
  std::uint8_t data_id;  ///< closes the CRC, so that a frame cannot pass under another's identifier
  std::vector<SignalLayout> signals;
};

constexpr std::uint32_t kTpCommandId = 0x110;
constexpr std::uint32_t kTpCommandInfoId = 0x111;
constexpr std::uint32_t kTpStatusId = 0x112;
constexpr std::uint32_t kTruckFeedbackId = 0x120;
constexpr std::uint32_t kTruckMotionId = 0x121;
constexpr std::uint32_t kTruckStatusId = 0x122;
constexpr std::uint32_t kOperatorId = 0x123;
constexpr std::uint32_t kCoils1Id = 0x124;
constexpr std::uint32_t kCoils2Id = 0x125;

/// All frames, in the order of the .dbc.
const std::vector<FrameLayout>& frameLayouts();

/// The layout of an identifier, or nullptr.
const FrameLayout* findLayout(std::uint32_t id);

}  // namespace tunnel_pilot::can
