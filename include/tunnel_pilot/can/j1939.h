#pragma once

#include <array>
#include <cstdint>

namespace tunnel_pilot::can {

constexpr std::uint8_t kGlobalAddress = 255;  ///< destination: everybody
constexpr std::uint8_t kNullAddress = 254;    ///< source of who has no address
constexpr std::uint8_t kMaxAddress = 253;     ///< that can be claimed
constexpr std::uint32_t kRequestPgn = 0xEA00;
constexpr std::uint32_t kAddressClaimedPgn = 0xEE00;

/// The parts of a 29-bit identifier (SAE J1939-21): from the top 3 bits of priority, 18 of the parameter
/// group, 8 of the source. A group whose format byte is below 240 (PDU1) is sent to a destination, which
/// stands in the group's lowest byte; the others (PDU2) go to everybody.
struct J1939Id {
  std::uint8_t priority = 6;  ///< 0..7, 0 is the most urgent
  std::uint32_t pgn = 0;      ///< parameter group number, 18 bits; of PDU1 the lowest byte is 0
  std::uint8_t destination = kGlobalAddress;
  std::uint8_t source = kNullAddress;
};

std::uint32_t toIdentifier(const J1939Id& id);
J1939Id fromIdentifier(std::uint32_t identifier);

/// What a node is called (SAE J1939-81). Of two that want one address, the lower number gets it.
struct J1939Name {
  std::uint32_t identity_number = 0;         ///< 21 bits
  std::uint16_t manufacturer_code = 0;       ///< 11 bits
  std::uint8_t ecu_instance = 0;             ///< 3 bits
  std::uint8_t function_instance = 0;        ///< 5 bits
  std::uint8_t function = 0;                 ///< 8 bits
  std::uint8_t vehicle_system = 0;           ///< 7 bits
  std::uint8_t vehicle_system_instance = 0;  ///< 4 bits
  std::uint8_t industry_group = 0;           ///< 3 bits
};

/// The NAME as its 64 bits; "arbitrary address capable" is 0: an address is commissioned, never sought.
std::uint64_t toNumber(const J1939Name& name);

/// Who sends a frame of the .dbc.
enum class Side { kPilot, kTruck };

/// How a frame of the .dbc travels under J1939: a proprietary B group.
struct J1939Group {
  std::uint32_t id;  ///< of the plain profile, by which all rooms above know the frame
  std::uint32_t pgn;
  std::uint8_t priority;
  Side sender;
};

/// All frames, in the order of the .dbc.
const std::array<J1939Group, 9>& j1939Groups();

}  // namespace tunnel_pilot::can
