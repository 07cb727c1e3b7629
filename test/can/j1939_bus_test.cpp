#include "tunnel_pilot/can/j1939_bus.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "fake_can_socket.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/can/socket_can_bus.h"

namespace tunnel_pilot::can {
namespace {

constexpr std::uint8_t kPilot = 0x80, kTruck = 0x81, kStranger = 0x55;
constexpr std::uint64_t kName = 0x3000FF00FFE00001;

Stamp ms(int milliseconds) { return std::chrono::milliseconds(milliseconds); }

J1939Parameters pilot() { return {Side::kPilot, kPilot, kTruck, kName}; }

Frame makeFrame(std::uint32_t id, bool extended = true) {
  Frame frame;
  frame.id = id;
  frame.extended = extended;
  frame.length = 8;
  return frame;
}

Frame claimOf(std::uint64_t name, std::uint8_t address = kPilot) {
  Frame frame = makeFrame(toIdentifier({6, kAddressClaimedPgn, kGlobalAddress, address}));
  for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(name >> 8 * i);
  return frame;
}

Frame request(std::uint8_t destination) {
  Frame frame = makeFrame(toIdentifier({6, kRequestPgn, destination, kStranger}));
  frame.length = 3;
  frame.data = {0x00, 0xEE, 0x00};
  return frame;
}

class J1939BusTest : public testing::Test {
 protected:
  J1939BusTest() : wire(hub.connect()), bus(pilot(), hub.connect()) {}

  /// Runs in ticks, for a time; what the bus's user got is in `received`, what came onto the wire in
  /// `sent`.
  void run(Stamp time, Stamp tick = ms(5)) {
    for (const Stamp end = now + time; now < end;) {
      now += tick;
      bus.tick(now);
      while (const auto frame = bus.receive()) received.push_back(*frame);
      while (const auto frame = wire->receive()) sent.push_back(*frame);
    }
  }
  void hold() {
    run(ms(300));
    sent.clear();
  }
  bool sendsCommand() { return bus.send(*encode(TruckCommandFrame())); }
  /// What the user gets when this comes over the wire.
  Frame handedUp(const Frame& frame) {
    received.clear();
    wire->send(frame);
    run(ms(5));
    return received.size() == 1 ? received[0] : Frame{0xFFFFFFFF, true, 0, {}};
  }

  MemoryBusHub hub;
  std::unique_ptr<Bus> wire;
  J1939Bus bus;
  Stamp now = fromSeconds(77.7);
  std::vector<Frame> received, sent;
};

// -------- the claim

TEST_F(J1939BusTest, ClaimsWithItsNameToAllBeforeAnythingElse) {
  run(ms(5));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].id, 0x18EEFF80u);
  EXPECT_TRUE(sent[0].extended);
  EXPECT_EQ(sent[0].data, claimOf(kName).data);
  EXPECT_EQ(sent[0].length, 8);
}

TEST_F(J1939BusTest, SendsNothingOfItsUsersUntilTheClaimIs250MillisecondsOld) {
  run(ms(1), ms(1));
  for (int i = 0; i < 250; ++i) {
    EXPECT_FALSE(sendsCommand());
    EXPECT_EQ(bus.state(), BusState::kDown);
    run(ms(1), ms(1));
  }
  EXPECT_FALSE(sendsCommand());
  run(ms(1), ms(1));
  EXPECT_TRUE(sendsCommand());
  EXPECT_EQ(bus.state(), BusState::kActive);
  EXPECT_EQ(bus.trouble(), "");
  EXPECT_EQ(std::count_if(sent.begin(), sent.end(), [](const Frame& f) { return f.id != 0x18EEFF80; }),
            0);
}

TEST_F(J1939BusTest, AHigherNameIsAnsweredWithTheClaimAndTheAddressKept) {
  hold();
  wire->send(claimOf(kName + 1));
  run(ms(20));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].id, 0x18EEFF80u);
  EXPECT_EQ(sent[0].data, claimOf(kName).data);
  EXPECT_TRUE(sendsCommand());
  EXPECT_EQ(bus.trouble(), "");
}

TEST_F(J1939BusTest, AHigherNameDuringTheContentionMakesItWaitAnew) {
  run(ms(200));
  wire->send(claimOf(kName + 1));
  run(ms(200));
  EXPECT_EQ(sent.size(), 2u);
  EXPECT_FALSE(sendsCommand());
  run(ms(70));
  EXPECT_TRUE(sendsCommand());
}

TEST_F(J1939BusTest, ALowerNameTakesTheAddressAtOnce) {
  hold();
  wire->send(claimOf(kName - 1));
  run(ms(5));
  EXPECT_FALSE(sendsCommand());
  EXPECT_EQ(bus.state(), BusState::kDown);
  EXPECT_NE(bus.trouble().find("J1939 address 128 is lost to NAME 0x3000FF00FFE00000"),
            std::string::npos)
      << bus.trouble();
}

TEST_F(J1939BusTest, ALowerNameDuringTheContentionTakesTheAddress) {
  run(ms(100));
  wire->send(claimOf(kName - 1));
  run(ms(1000));
  EXPECT_FALSE(sendsCommand());
  EXPECT_NE(bus.trouble(), "");
}

TEST_F(J1939BusTest, ItsOwnNameFromElsewhereTakesTheAddress) {
  hold();
  wire->send(claimOf(kName));
  run(ms(5));
  EXPECT_FALSE(sendsCommand());
}

TEST_F(J1939BusTest, OfTwoThatClaimTheLowerNameGetsTheAddressWhoeverComesFirst) {
  for (const bool lower_first : {true, false}) {
    MemoryBusHub both;
    J1939Parameters low = pilot(), high = pilot();
    high.name = kName + 1;
    J1939Bus lower(low, both.connect()), higher(high, both.connect());
    for (int i = 0; i < 200; ++i) {
      const auto step = [&](J1939Bus& one) {
        one.tick(ms(5 * i));
        while (one.receive()) {
        }
      };
      if (lower_first || i >= 20) step(lower);
      if (!lower_first || i >= 20) step(higher);
    }
    EXPECT_EQ(lower.state(), BusState::kActive);
    EXPECT_EQ(higher.state(), BusState::kDown);
  }
}

TEST_F(J1939BusTest, TheLoserTellsThatItCannotClaimOnceAndIsSilent) {
  hold();
  wire->send(claimOf(kName - 1));
  run(ms(250));
  ASSERT_EQ(sent.size(), 1u) << "within 250 ms";
  EXPECT_EQ(sent[0].id, 0x18EEFFFEu);
  EXPECT_EQ(sent[0].data, claimOf(kName).data);
  sent.clear();
  for (int i = 0; i < 100; ++i) {
    sendsCommand();
    run(ms(100));
  }
  EXPECT_TRUE(sent.empty());
}

TEST_F(J1939BusTest, TheLoserStaysSilentAfterTheBusWasDown) {
  hold();
  wire->send(claimOf(kName - 1));
  run(ms(300));
  hub.setState(BusState::kDown);
  run(ms(300));
  hub.setState(BusState::kActive);
  sent.clear();
  run(ms(1000));
  EXPECT_TRUE(sent.empty());
  EXPECT_FALSE(sendsCommand());
}

TEST_F(J1939BusTest, ARequestForClaimsIsAnsweredToAllAndToItself) {
  hold();
  for (const std::uint8_t destination : {kGlobalAddress, kPilot}) {
    sent.clear();
    wire->send(request(destination));
    run(ms(25));
    ASSERT_EQ(sent.size(), 1u);
    EXPECT_EQ(sent[0].data, claimOf(kName).data);
  }
  EXPECT_TRUE(received.empty()) << "a request is nothing for the bus's user";
  sent.clear();
  wire->send(request(kTruck));
  run(ms(25));
  EXPECT_TRUE(sent.empty()) << "somebody else is asked";
}

TEST_F(J1939BusTest, WhatIsNoRequestForClaimsIsNotAnswered) {
  hold();
  std::vector<Frame> frames(4, request(kPilot));
  frames[0].length = 4;
  frames[1].data[1] = 0xEB;  // another group is asked for
  frames[2].id = toIdentifier({6, kRequestPgn + 0x100, kPilot, kStranger});  // another group asks
  frames[3].id = toIdentifier({6, kRequestPgn, kPilot, kPilot});             // in the pilot's own name
  for (const Frame& frame : frames) wire->send(frame);
  run(ms(50));
  EXPECT_TRUE(sent.empty());
  EXPECT_EQ(received.size(), frames.size());
}

TEST_F(J1939BusTest, ClaimsOfOtherAddressesAreNobodysBusiness) {
  hold();
  wire->send(claimOf(kName - 1, kStranger));
  run(ms(50));
  EXPECT_TRUE(sent.empty());
  EXPECT_TRUE(sendsCommand());
}

TEST_F(J1939BusTest, TheLoserAnswersARequestWithoutTheAddress) {
  hold();
  wire->send(claimOf(kName - 1));
  run(ms(300));
  sent.clear();
  wire->send(request(kGlobalAddress));
  run(ms(250));
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].id, 0x18EEFFFEu);
}

TEST_F(J1939BusTest, AFloodOfRequestsIsAnsweredOnceIn20Milliseconds) {
  hold();
  for (int i = 0; i < 250; ++i) {
    wire->send(request(kGlobalAddress));
    wire->send(claimOf(kName + 1));
    run(ms(1), ms(1));
  }
  EXPECT_LE(sent.size(), 13u);
  EXPECT_GE(sent.size(), 12u);
}

// The bytes of this NAME add up to nothing, so that the standard lets the loser answer at once.
TEST_F(J1939BusTest, AFloodOfRequestsIsAnsweredByTheLoserOnceIn20Milliseconds) {
  bus = J1939Bus({Side::kPilot, kPilot, kTruck, 0x3000FF00FFE000F2}, hub.connect());
  hold();
  wire->send(claimOf(kName - 1));
  run(ms(5));
  sent.clear();
  for (int i = 0; i < 250; ++i) {
    wire->send(request(kGlobalAddress));
    run(ms(1), ms(1));
  }
  EXPECT_LE(sent.size(), 13u);
  EXPECT_GE(sent.size(), 12u);
}

TEST_F(J1939BusTest, ABusThatComesAndGoesIsClaimedOnOnceIn20Milliseconds) {
  for (int i = 0; i < 125; ++i) {
    hub.setState(BusState::kDown);
    run(ms(1), ms(1));
    hub.setState(BusState::kActive);
    run(ms(1), ms(1));
  }
  EXPECT_LE(sent.size(), 13u);
  EXPECT_GE(sent.size(), 12u);
}

TEST_F(J1939BusTest, AfterTheBusWasDownItClaimsAnew) {
  hold();
  hub.setState(BusState::kBusOff);
  run(ms(20));
  EXPECT_EQ(bus.state(), BusState::kBusOff);
  hub.setState(BusState::kActive);
  EXPECT_FALSE(sendsCommand());
  run(ms(250));
  EXPECT_FALSE(sendsCommand());
  run(ms(10));
  EXPECT_TRUE(sendsCommand());
  EXPECT_EQ(sent.size(), 1u);
}

TEST_F(J1939BusTest, AClockThatJumpsBackProlongsTheContentionByATickAtMost) {
  run(ms(205));
  now -= std::chrono::hours(1);
  run(ms(60));
  EXPECT_TRUE(sendsCommand());
}

TEST_F(J1939BusTest, AClockThatJumpsAheadByAnyTimeDoesNotShortenTheContention) {
  for (const Stamp jump : {ms(1), ms(7), ms(20), ms(45), ms(200), ms(3600000)}) {
    hub.setState(BusState::kDown);
    run(ms(5));
    hub.setState(BusState::kActive);
    run(ms(105));  // the claim goes out with the first tick
    now += jump;
    run(ms(145));
    EXPECT_FALSE(sendsCommand()) << "after a jump of " << toSeconds(jump) << " s";
    run(ms(10));
    EXPECT_TRUE(sendsCommand()) << "after a jump of " << toSeconds(jump) << " s";
  }
}

TEST_F(J1939BusTest, ANameOfEightBytesAloneContends) {
  hold();
  Frame odd = claimOf(0);
  odd.length = 7;
  wire->send(odd);
  wire->send(claimOf(0, kStranger));
  run(ms(50));
  EXPECT_TRUE(sendsCommand());
}

// -------- what passes

TEST_F(J1939BusTest, SendsEachOfItsFramesAsItsGroupWithTheSameBytes) {
  hold();
  for (const J1939Group& group : j1939Groups()) {
    sent.clear();
    Frame frame = makeFrame(group.id, false);
    frame.data = {1, 2, 3, 4, 5, 6, 7, 8};
    EXPECT_EQ(bus.send(frame), group.sender == Side::kPilot);
    run(ms(5));
    if (group.sender != Side::kPilot) continue;
    ASSERT_EQ(sent.size(), 1u);
    EXPECT_EQ(sent[0].id, (group.priority << 26) | (group.pgn << 8) | kPilot);
    EXPECT_TRUE(sent[0].extended);
    EXPECT_EQ(sent[0].data, frame.data);
  }
}

TEST_F(J1939BusTest, SendsNothingButItsOwnFrames) {
  hold();
  EXPECT_FALSE(bus.send(*encode(TruckFeedbackFrame())));
  EXPECT_FALSE(bus.send(makeFrame(0x7FF, false)));
  Frame extended = *encode(TruckCommandFrame());
  extended.extended = true;
  EXPECT_FALSE(bus.send(extended));
  run(ms(5));
  EXPECT_TRUE(sent.empty());
  EXPECT_EQ(bus.trouble(), "");
}

TEST_F(J1939BusTest, GivesThePartnersFramesWhateverTheirPriority) {
  hold();
  for (const J1939Group& group : j1939Groups()) {
    if (group.sender == Side::kPilot) continue;
    for (std::uint8_t priority = 0; priority < 8; ++priority) {
      const Frame got = handedUp(makeFrame(toIdentifier({priority, group.pgn, kGlobalAddress, kTruck})));
      EXPECT_EQ(got.id, group.id);
      EXPECT_FALSE(got.extended);
    }
  }
}

TEST_F(J1939BusTest, AGroupOfItsOwnFromOutsideIsAForeignSendersFromAnyAddress) {
  hold();
  for (const std::uint8_t source : {kPilot, kTruck, kStranger, kNullAddress}) {
    const Frame got = handedUp(makeFrame(toIdentifier({3, 0xFF11, kGlobalAddress, source})));
    EXPECT_EQ(got.id, kTpCommandInfoId);
    EXPECT_FALSE(got.extended);
  }
}

TEST_F(J1939BusTest, AnythingFromItsOwnAddressIsAForeignSenders) {
  hold();
  for (const std::uint32_t pgn : {0x0000u, 0xEA00u, 0xFEF1u, 0xFF20u, 0x1FF10u}) {
    const Frame got = handedUp(makeFrame(toIdentifier({6, pgn, kGlobalAddress, kPilot})));
    EXPECT_EQ(got.id, kTpCommandId) << std::hex << pgn;
    EXPECT_FALSE(got.extended);
  }
}

TEST_F(J1939BusTest, TheTrucksGroupsFromAnotherAddressAreStrangers) {
  hold();
  for (unsigned source = 0; source < 256; ++source) {
    if (source == kTruck || source == kPilot) continue;
    const auto stranger = static_cast<std::uint8_t>(source);
    const Frame got = handedUp(makeFrame(toIdentifier({3, 0xFF20, kGlobalAddress, stranger})));
    EXPECT_TRUE(got.extended) << source;
  }
}

// What may reach a bridge as more than a stranger's: by the definition, not by the code.
bool mayPass(const Frame& frame) {
  if (!frame.extended) return false;
  const std::uint32_t pgn = frame.id >> 8 & 0x3FFFF, source = frame.id & 0xFF;
  if (source == kPilot || (pgn >= 0xFF10 && pgn <= 0xFF12)) return true;
  return source == kTruck && pgn >= 0xFF20 && pgn <= 0xFF25;
}

bool isManagement(const Frame& frame) {
  const std::uint32_t format = frame.id >> 16 & 0x3FF;
  return frame.extended && (format == 0xEE || format == 0xEA);
}

std::vector<Frame> allElevenBitsAndAMillionOf29() {
  std::vector<Frame> frames;
  for (std::uint32_t id = 0; id < 2048; ++id) frames.push_back(makeFrame(id, false));
  std::mt19937 random(20191108);
  for (int i = 0; i < 1'000'000; ++i) {
    std::uint32_t id = random() & 0x1FFFFFFF;
    if (i % 4 == 1) id = (id & ~0xFFu) | (i % 8 == 1 ? kPilot : kTruck);
    if (i % 4 == 2) id = (id & 0x1C00003F) | 0x00FF0000 | (id & 0x3F00);  // near our groups
    if (i % 4 == 3) id = 0x00FF0000 | (id & 0x1C003FFF);
    frames.push_back(makeFrame(id));
  }
  return frames;
}

TEST(J1939Filter, OfAllElevenBitsAndAMillionOf29ThoseOfTheProfileAlonePass) {
  MemoryBusHub hub;
  const auto wire = hub.connect();
  J1939Bus bus(pilot(), hub.connect());
  int passed = 0;
  for (const Frame& frame : allElevenBitsAndAMillionOf29()) {
    if (isManagement(frame)) continue;
    wire->send(frame);
    const auto got = bus.receive();
    ASSERT_TRUE(got);
    ASSERT_EQ(!got->extended, mayPass(frame)) << std::hex << frame.id << (frame.extended ? "x" : "");
    passed += !got->extended;
  }
  EXPECT_GT(passed, 1000);
}

TEST(J1939Filter, OfTheKernelLetsThroughWhatTheBusNeedsAndNothingElse) {
  const std::vector<Identifier> listen = j1939Identifiers(pilot());
  const auto heard = [&](const Frame& frame) {
    return std::any_of(listen.begin(), listen.end(),
                       [&](const Identifier& identifier) { return matches(identifier, frame); });
  };
  for (const Frame& frame : allElevenBitsAndAMillionOf29()) {
    if (isManagement(frame)) continue;
    ASSERT_EQ(heard(frame), mayPass(frame)) << std::hex << frame.id;
  }
  EXPECT_TRUE(heard(claimOf(1)));
  EXPECT_TRUE(heard(claimOf(1, kNullAddress))) << "the loser's own, whose echo proves it";
  EXPECT_FALSE(heard(claimOf(1, kStranger)));
  EXPECT_TRUE(heard(request(kGlobalAddress)));
  EXPECT_TRUE(heard(request(kPilot)));
  EXPECT_FALSE(heard(request(kTruck)));
}

// -------- on SocketCAN

class J1939OnSocketCan : public testing::Test {
 protected:
  J1939OnSocketCan()
      : bus(pilot(), std::make_unique<SocketCanBus>("can0", j1939Identifiers(pilot()),
                                                    std::make_unique<FakeCanSocket>(kernel))) {}
  void run(Stamp time) {
    for (const Stamp end = now + time; now < end;) {
      now += ms(5);
      bus.tick(now);
      while (bus.receive()) {
      }
    }
  }
  FakeKernel kernel;
  J1939Bus bus;
  Stamp now = fromSeconds(77.7);
};

TEST_F(J1939OnSocketCan, TheContentionBeginsWhenTheClaimIsProvenToBeSent) {
  kernel.stall();  // nobody acknowledges
  run(ms(2000));
  EXPECT_EQ(bus.state(), BusState::kDown);
  EXPECT_NE(bus.trouble().find("not claimed"), std::string::npos) << bus.trouble();
  bus.discard();
  EXPECT_EQ(kernel.cycles, 0) << "a claim that waits is no reason to cycle the link";
  kernel.release();
  run(ms(240));
  EXPECT_EQ(bus.state(), BusState::kDown);
  run(ms(30));
  EXPECT_EQ(bus.state(), BusState::kActive);
  EXPECT_EQ(kernel.sent.size(), 1u);
}

TEST_F(J1939OnSocketCan, AClaimThatFindsNoRoomInTheQueueIsToldAfterASecond) {
  kernel.stall();
  kernel.queue.resize(FakeKernel::kQueueLength);  // of another program's frames
  run(ms(990));
  EXPECT_EQ(bus.trouble(), "");
  run(ms(30));
  EXPECT_NE(bus.trouble().find("not claimed"), std::string::npos) << bus.trouble();
  EXPECT_TRUE(kernel.sent.empty());
}

TEST_F(J1939OnSocketCan, TellsTheTroubleBelowFirst) {
  kernel.down();
  run(ms(100));
  EXPECT_EQ(bus.trouble(), "can0 is down: ip link set can0 up");
}

TEST_F(J1939OnSocketCan, AStalledQueueIsDiscardedOnceTheAddressIsHeld) {
  run(ms(300));
  kernel.stall();
  ASSERT_TRUE(bus.send(*encode(TruckCommandFrame())));
  bus.discard();
  EXPECT_EQ(kernel.cycles, 1);
}

// -------- parameters

std::string configFile(const std::string& name) {
  return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name;
}

Profile load(const YAML::Node& yaml, Side side) {
  config::Node node(yaml, "x.yaml");
  return loadProfile(node, side);
}

std::string refusal(const YAML::Node& yaml) {
  try {
    load(yaml, Side::kPilot);
  } catch (const config::ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Profile, OfTheShippedFilesAgree) {
  const Profile pilots = load(YAML::LoadFile(configFile("can_bridge.yaml")), Side::kPilot);
  const Profile trucks = load(YAML::LoadFile(configFile("truck_controller.yaml")), Side::kTruck);
  EXPECT_EQ(pilots.kind, ProfileKind::kPlain);
  EXPECT_NO_THROW(requireAgreement(pilots, trucks));
  EXPECT_EQ(pilots.j1939.name, kName);
}

TEST(Profile, IsTheOneThatTheFileNames) {
  YAML::Node yaml = YAML::LoadFile(configFile("can_bridge.yaml"));
  yaml["profile"] = "j1939";
  EXPECT_EQ(load(yaml, Side::kPilot).kind, ProfileKind::kJ1939);
}

TEST(Profile, ThatDoNotAgreeAreRefused) {
  const Profile pilots = load(YAML::LoadFile(configFile("can_bridge.yaml")), Side::kPilot);
  Profile trucks = load(YAML::LoadFile(configFile("truck_controller.yaml")), Side::kTruck);
  trucks.kind = ProfileKind::kJ1939;
  EXPECT_THROW(requireAgreement(pilots, trucks), config::ConfigError);
  Profile other = pilots;
  other.kind = ProfileKind::kJ1939;
  EXPECT_NO_THROW(requireAgreement(other, trucks));
  other.j1939.partner_address = 7;
  EXPECT_THROW(requireAgreement(other, trucks), config::ConfigError);
  other = pilots;
  other.kind = ProfileKind::kJ1939;
  other.j1939.source_address = 7;
  EXPECT_THROW(requireAgreement(other, trucks), config::ConfigError);
}

TEST(Profile, RefusesAnUnknownOneAndAddressesOutOfRangeByTheirNames) {
  const YAML::Node good = YAML::LoadFile(configFile("can_bridge.yaml"));
  const auto with = [&](auto change) {
    YAML::Node yaml = YAML::Clone(good);
    change(yaml);
    return refusal(yaml);
  };
  const auto has = [](const std::string& text, const std::string& words) {
    EXPECT_NE(text.find(words), std::string::npos) << text;
  };
  has(with([](YAML::Node& y) { y["profile"] = "canopen"; }), "'profile'");
  has(with([](YAML::Node& y) { y["j1939"]["source_address"] = 254; }), "'j1939.source_address'");
  has(with([](YAML::Node& y) { y["j1939"]["truck_address"] = 128; }), "must differ");
  has(with([](YAML::Node& y) { y["j1939"]["pilot_address"] = 3; }), "pilot_address");
  has(with([](YAML::Node& y) { y["j1939"].remove("truck_address"); }), "'j1939.truck_address'");
}

TEST(Profile, RefusesEveryFieldOfTheNameBeyondItsBits) {
  const YAML::Node good = YAML::LoadFile(configFile("can_bridge.yaml"));
  int fields = 0;
  for (const auto& entry : good["j1939"]["name"]) {
    const std::string key = entry.first.Scalar();
    for (const char* bad : {"-1", "2097152", "1.5", "text", "~"}) {
      YAML::Node yaml = YAML::Clone(good);
      yaml["j1939"]["name"][key] = YAML::Load(bad);
      EXPECT_NE(refusal(yaml).find("'j1939.name." + key + "'"), std::string::npos) << key << bad;
    }
    ++fields;
  }
  EXPECT_EQ(fields, 8);
}

TEST(Profile, PlainLeavesTheBusAsItIs) {
  MemoryBusHub hub;
  auto inner = hub.connect();
  const Bus* before = inner.get();
  EXPECT_EQ(withProfile(Profile(), std::move(inner)).get(), before);
  EXPECT_EQ(identifiersOf(Profile()).size(), 9u);
}

}  // namespace
}  // namespace tunnel_pilot::can
