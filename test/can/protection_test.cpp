#include "tunnel_pilot/can/protection.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>
#include <functional>
#include <random>
#include <vector>

#include "tunnel_pilot/can/codec.h"

namespace tunnel_pilot::can {
namespace {

void flip(Frame& frame, int bit) {
  frame.data[static_cast<std::size_t>(bit / 8)] ^= static_cast<std::uint8_t>(1 << (bit % 8));
}

struct Kind {
  Frame frame;
  std::function<bool(const Frame&)> accepts;
};

template <class Fields>
Kind kindOf(const Fields& fields) {
  return {*encode(fields), [](const Frame& frame) { return decode<Fields>(frame).has_value(); }};
}

// One frame of every kind, with numbers in the middle of their ranges so that no range check helps the
// CRC.
std::vector<Kind> allKinds() {
  TruckCommandFrame command;
  command.articulation_angle = 0.2;
  command.speed = 3.0;
  command.acceleration = 0.8;
  command.steering_enable = true;
  CommandInfoFrame info;
  info.sequence = 0x12345678;
  info.measurement_stamp_ms = 4711;
  BridgeStatusFrame status;
  status.state = 3;
  TruckFeedbackFrame feedback;
  feedback.articulation_angle = -0.1;
  feedback.speed = 2.5;
  TruckMotionFrame motion;
  motion.yaw_rate = 0.05;
  motion.front_axle_speed = 2.5;
  TruckStatusFrame truck;
  truck.payload = 35000;
  truck.brake_pressure = 1e6;
  OperatorFrame operator_frame;
  operator_frame.steering_wheel = 0.5;
  Coils1Frame coils1;
  coils1.coils = {0.1, 0.2, 0.3, 0.4};
  Coils2Frame coils2;
  coils2.coils = {0.5, 0.6, 0.7};
  return {kindOf(command), kindOf(info),           kindOf(status), kindOf(feedback), kindOf(motion),
          kindOf(truck),   kindOf(operator_frame), kindOf(coils1), kindOf(coils2)};
}

TEST(Crc, HasItsPublishedCheckValue) {
  const char* text = "123456789";
  EXPECT_EQ(crc8(reinterpret_cast<const std::uint8_t*>(text), std::strlen(text)), 0xDF);
}

TEST(Crc, FindsEveryCorruptionOfOneTwoOrThreeBitsInEveryFrame) {
  long tried = 0, passed = 0;
  for (const Kind& kind : allKinds()) {
    ASSERT_TRUE(kind.accepts(kind.frame));
    const auto count = [&](const Frame& frame) { ++tried, passed += kind.accepts(frame) ? 1 : 0; };
    for (int a = 0; a < 64; ++a) {
      Frame one = kind.frame;
      flip(one, a);
      count(one);
      for (int b = a + 1; b < 64; ++b) {
        Frame two = one;
        flip(two, b);
        count(two);
        for (int c = b + 1; c < 64; ++c) {
          Frame three = two;
          flip(three, c);
          count(three);
        }
      }
    }
  }
  EXPECT_EQ(tried, 9 * (64 + 2016 + 41664));
  EXPECT_EQ(passed, 0);
  std::printf("corruptions of 1, 2 and 3 bits: %ld tried, %ld passed\n", tried, passed);
}

TEST(Crc, RandomBytesPassOnlyByChanceAndNeverCrash) {
  std::mt19937_64 random(7);
  const std::vector<Kind> kinds = allKinds();
  long tried = 0, passed = 0;
  for (int i = 0; i < 200000; ++i) {
    for (const Kind& kind : kinds) {
      Frame frame = kind.frame;
      const std::uint64_t bits = random();
      std::memcpy(frame.data.data(), &bits, 8);
      frame.length = i % 4 == 0 ? static_cast<std::uint8_t>(random()) : frame.length;
      ++tried, passed += kind.accepts(frame) ? 1 : 0;
    }
  }
  EXPECT_LT(static_cast<double>(passed) / static_cast<double>(tried), 1.0 / 256.0);
  std::printf("random frames: %ld tried, %ld passed\n", tried, passed);
}

TEST(StreamCheck, AcceptsStepsOfOneAndTwoRoundTheWrap) {
  StreamCheck check;
  std::uint8_t counter = 11;
  EXPECT_TRUE(check.accept(counter));
  for (int i = 0; i < 40; ++i) {
    const int step = 1 + i % 2;
    counter = static_cast<std::uint8_t>((counter + step) % kCounterModulus);
    EXPECT_TRUE(check.accept(counter)) << i;
  }
  EXPECT_FALSE(check.faulty());
}

TEST(StreamCheck, RefusesRepeatsAndEveryLargerStep) {
  for (int last = 0; last < kCounterModulus; ++last) {
    for (int step = 0; step < kCounterModulus; ++step) {
      StreamCheck check;
      check.accept(static_cast<std::uint8_t>(last));
      const bool right = check.accept(static_cast<std::uint8_t>((last + step) % kCounterModulus));
      EXPECT_EQ(right, step == 1 || step == 2) << last << " + " << step;
    }
  }
}

TEST(StreamCheck, RefusesTheCounterThatIsNeverSent) {
  StreamCheck check;
  EXPECT_FALSE(check.accept(15));
}

TEST(StreamCheck, IsFaultyWithThreeWrongInTenAndNotWithTwo) {
  StreamCheck check;
  std::uint8_t counter = 0;
  const auto good = [&] { EXPECT_TRUE(check.accept(counter = nextCounter(counter))); };
  check.accept(counter);
  check.reject();
  for (int i = 0; i < 3; ++i) good();
  check.reject();
  for (int i = 0; i < 3; ++i) good();
  EXPECT_FALSE(check.faulty());
  check.reject();
  EXPECT_TRUE(check.faulty());
}

TEST(StreamCheck, ForgetsWrongFramesAfterTen) {
  StreamCheck check;
  std::uint8_t counter = 0;
  check.accept(counter);
  for (int i = 0; i < 3; ++i) check.reject();
  for (int i = 0; i < 7; ++i) check.accept(counter = nextCounter(counter));
  EXPECT_TRUE(check.faulty());
  check.accept(counter = nextCounter(counter));
  EXPECT_FALSE(check.faulty());
}

TEST(StreamCheck, RemembersWrongCountersAsLongAsFramesThatCouldNotBeDecoded) {
  StreamCheck check;
  std::uint8_t counter = 0;
  check.accept(counter);
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(check.accept(counter));
  for (int i = 0; i < 7; ++i) check.accept(counter = nextCounter(counter));
  EXPECT_TRUE(check.faulty());
  check.accept(counter = nextCounter(counter));
  EXPECT_FALSE(check.faulty());
}

TEST(StreamCheck, ReplayedFrameStreamIsFaultyWithinThreeFrames) {
  StreamCheck check;
  check.accept(4);
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(check.accept(4));
  EXPECT_TRUE(check.faulty());
}

}  // namespace
}  // namespace tunnel_pilot::can
