#include "tunnel_pilot/can/j1939.h"

#include "tunnel_pilot/can/layout.h"

namespace tunnel_pilot::can {
namespace {

constexpr std::uint32_t kPgnMask = 0x3FFFF;
constexpr std::uint32_t kFirstPdu2Format = 240;

bool hasDestination(std::uint32_t pgn) { return (pgn >> 8 & 0xFF) < kFirstPdu2Format; }

}  // namespace

std::uint32_t toIdentifier(const J1939Id& id) {
  std::uint32_t pgn = id.pgn & kPgnMask;
  if (hasDestination(pgn)) pgn = (pgn & ~0xFFu) | id.destination;
  return (id.priority & 7u) << 26 | pgn << 8 | id.source;
}

J1939Id fromIdentifier(std::uint32_t identifier) {
  J1939Id id;
  id.priority = static_cast<std::uint8_t>(identifier >> 26 & 7u);
  id.pgn = identifier >> 8 & kPgnMask;
  id.source = static_cast<std::uint8_t>(identifier & 0xFFu);
  if (hasDestination(id.pgn)) {
    id.destination = static_cast<std::uint8_t>(id.pgn & 0xFFu);
    id.pgn &= ~0xFFu;
  }
  return id;
}

std::uint64_t toNumber(const J1939Name& name) {
  const auto field = [](std::uint64_t value, int bits, int start) {
    return (value & ((std::uint64_t{1} << bits) - 1)) << start;
  };
  return field(name.identity_number, 21, 0) | field(name.manufacturer_code, 11, 21) |
         field(name.ecu_instance, 3, 32) | field(name.function_instance, 5, 35) |
         field(name.function, 8, 40) | field(name.vehicle_system, 7, 49) |
         field(name.vehicle_system_instance, 4, 56) | field(name.industry_group, 3, 60);
}

const std::array<J1939Group, 9>& j1939Groups() {
  // Priority 3 for what the other side's watchdogs wait for, 6 for information.
  static const std::array<J1939Group, 9> groups = {{{kTpCommandId, 0xFF10, 3, Side::kPilot},
                                                    {kTpCommandInfoId, 0xFF11, 6, Side::kPilot},
                                                    {kTpStatusId, 0xFF12, 6, Side::kPilot},
                                                    {kTruckFeedbackId, 0xFF20, 3, Side::kTruck},
                                                    {kTruckMotionId, 0xFF21, 3, Side::kTruck},
                                                    {kTruckStatusId, 0xFF22, 3, Side::kTruck},
                                                    {kOperatorId, 0xFF23, 6, Side::kTruck},
                                                    {kCoils1Id, 0xFF24, 6, Side::kTruck},
                                                    {kCoils2Id, 0xFF25, 6, Side::kTruck}}};
  return groups;
}

}  // namespace tunnel_pilot::can
