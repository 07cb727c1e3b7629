#include "tunnel_pilot/can/j1939.h"

#include <gtest/gtest.h>

#include "tunnel_pilot/can/layout.h"

namespace tunnel_pilot::can {
namespace {

TEST(J1939Identifier, OfEveryGroupAddressAndPriorityComesBack) {
  for (const std::uint32_t pgn : {0x0u, 0xEA00u, 0xEE00u, 0xEF00u, 0xF000u, 0xFEF1u, 0xFF10u, 0xFF25u,
                                  0x1EF00u, 0x1FF10u, 0x2EF00u, 0x3FFFFu}) {
    for (unsigned source = 0; source < 256; ++source) {
      for (std::uint8_t priority = 0; priority < 8; ++priority) {
        const auto own = static_cast<std::uint8_t>(source);
        const J1939Id back = fromIdentifier(toIdentifier({priority, pgn, kGlobalAddress, own}));
        ASSERT_EQ(back.priority, priority);
        ASSERT_EQ(back.pgn, pgn);
        ASSERT_EQ(back.source, source);
        ASSERT_EQ(back.destination, kGlobalAddress);
      }
    }
  }
}

TEST(J1939Identifier, OfAGroupWithDestinationBringsItBack) {
  for (const std::uint32_t pgn : {0x0u, kRequestPgn, kAddressClaimedPgn, 0xEF00u, 0x1EF00u}) {
    for (unsigned destination = 0; destination < 256; ++destination) {
      const auto to = static_cast<std::uint8_t>(destination);
      const J1939Id back = fromIdentifier(toIdentifier({6, pgn, to, 0x80}));
      ASSERT_EQ(back.destination, destination);
      ASSERT_EQ(back.pgn, pgn);
    }
  }
}

// Worked examples of SAE J1939-21 and -81: engine speed, a global request, a claim, a cannot-claim.
TEST(J1939Identifier, IsThatOfTheStandardsExamples) {
  EXPECT_EQ(toIdentifier({3, 0xF004, kGlobalAddress, 0x00}), 0x0CF00400u);
  EXPECT_EQ(toIdentifier({6, kRequestPgn, kGlobalAddress, kNullAddress}), 0x18EAFFFEu);
  EXPECT_EQ(toIdentifier({6, kAddressClaimedPgn, kGlobalAddress, 0x80}), 0x18EEFF80u);
  EXPECT_EQ(toIdentifier({6, kAddressClaimedPgn, kGlobalAddress, kNullAddress}), 0x18EEFFFEu);
}

TEST(J1939Name, PutsEachFieldWhereTheStandardHasIt) {
  const auto number = [](auto set) {
    J1939Name name;
    set(name);
    return toNumber(name);
  };
  EXPECT_EQ(number([](J1939Name& n) { n.identity_number = 0x1FFFFF; }), 0x00000000001FFFFFu);
  EXPECT_EQ(number([](J1939Name& n) { n.manufacturer_code = 0x7FF; }), 0x00000000FFE00000u);
  EXPECT_EQ(number([](J1939Name& n) { n.ecu_instance = 7; }), 0x0000000700000000u);
  EXPECT_EQ(number([](J1939Name& n) { n.function_instance = 31; }), 0x000000F800000000u);
  EXPECT_EQ(number([](J1939Name& n) { n.function = 255; }), 0x0000FF0000000000u);
  EXPECT_EQ(number([](J1939Name& n) { n.vehicle_system = 127; }), 0x00FE000000000000u);
  EXPECT_EQ(number([](J1939Name& n) { n.vehicle_system_instance = 15; }), 0x0F00000000000000u);
  EXPECT_EQ(number([](J1939Name& n) { n.industry_group = 7; }), 0x7000000000000000u);
}

TEST(J1939Groups, AreProprietaryBWithTheLowerByteOfTheElevenBits) {
  ASSERT_EQ(j1939Groups().size(), frameLayouts().size());
  for (std::size_t i = 0; i < frameLayouts().size(); ++i) {
    EXPECT_EQ(j1939Groups()[i].id, frameLayouts()[i].id);
    EXPECT_EQ(j1939Groups()[i].pgn, 0xFF00 | (frameLayouts()[i].id & 0xFF));
  }
}

}  // namespace
}  // namespace tunnel_pilot::can
