// Fuzz target of what is read from the CAN bus (libFuzzer); scripts/fuzz builds and runs it. The first
// byte says what the others are: frames for the decoders and the stream checks, frames of the kernel,
// numbers to be encoded.
#include <linux/can.h>

#include <cmath>
#include <optional>

#include "../../fuzz.h"
#include "j1939_fuzz.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/linux_frame.h"
#include "tunnel_pilot/can/protection.h"

namespace tunnel_pilot::can {
namespace {

// The CRC bit by bit, as its definition has it.
std::uint8_t plainCrc(const Frame& frame, std::uint8_t data_id) {
  std::uint8_t crc = 0xFF;
  for (std::size_t i = 1; i <= 8; ++i) {
    crc ^= i < 8 ? frame.data[i] : data_id;
    for (int bit = 0; bit < 8; ++bit)
      crc = static_cast<std::uint8_t>(crc << 1 ^ (crc & 0x80 ? 0x2F : 0));
  }
  return crc ^ 0xFF;
}

std::uint64_t bitsOf(const Frame& frame) {
  std::uint64_t bits = 0;
  for (std::size_t i = 8; i-- > 0;) bits = bits << 8 | frame.data[i];
  return bits;
}

std::uint64_t maskOf(const SignalLayout& signal) {
  return ((std::uint64_t{1} << signal.length) - 1) << signal.start;
}

bool inRange(const SignalLayout& signal, std::uint64_t bits) {
  auto raw = static_cast<std::int64_t>((bits & maskOf(signal)) >> signal.start);
  if (signal.is_signed && raw >> (signal.length - 1) != 0) raw -= std::int64_t{1} << signal.length;
  const double value = static_cast<double>(raw) * signal.factor;
  const double slack = 1e-6 * signal.factor;
  return value >= signal.min - slack && value <= signal.max + slack;
}

// Whether a frame is right, worked out from the layout alone.
bool isRight(const FrameLayout& layout, const Frame& frame) {
  if (frame.extended || frame.length != 8 || frame.id != layout.id) return false;
  if (frame.data[0] != plainCrc(frame, layout.data_id)) return false;
  for (const SignalLayout& signal : layout.signals) {
    if (!inRange(signal, bitsOf(frame))) return false;
  }
  return true;
}

template <class Fields>
std::optional<std::uint8_t> checkFields(const Frame& frame, const FrameLayout& layout) {
  const std::optional<Fields> fields = decode<Fields>(frame);
  require(fields.has_value() == isRight(layout, frame), "the right frames are decoded, and no others");
  if (!fields) return std::nullopt;
  const std::optional<Frame> again = encode(*fields);
  require(again.has_value(), "what was decoded can be encoded");
  std::uint64_t used = 0;
  for (std::size_t i = 1; i < layout.signals.size(); ++i) used |= maskOf(layout.signals[i]);
  require((bitsOf(*again) & used) == (bitsOf(frame) & used), "encode(decode(frame)) is the frame");
  const std::optional<Fields> twice = decode<Fields>(*again);
  require(twice && encode(*twice)->data == again->data, "decode(encode(fields)) is the fields");
  return fields->counter;
}

// The decoder of one of the frames: the counter when it was decoded.
std::optional<std::uint8_t> check(std::size_t which, const Frame& frame) {
  const FrameLayout& layout = frameLayouts()[which];
  switch (which) {
    case 0:
      return checkFields<TruckCommandFrame>(frame, layout);
    case 1:
      return checkFields<CommandInfoFrame>(frame, layout);
    case 2:
      return checkFields<BridgeStatusFrame>(frame, layout);
    case 3:
      return checkFields<TruckFeedbackFrame>(frame, layout);
    case 4:
      return checkFields<TruckMotionFrame>(frame, layout);
    case 5:
      return checkFields<TruckStatusFrame>(frame, layout);
    case 6:
      return checkFields<OperatorFrame>(frame, layout);
    case 7:
      return checkFields<Coils1Frame>(frame, layout);
    default:
      return checkFields<Coils2Frame>(frame, layout);
  }
}

Frame takeFrame(FuzzBytes& bytes, std::size_t which) {
  const auto how = bytes.take<std::uint8_t>();
  const FrameLayout& layout = frameLayouts()[which];
  Frame frame;
  bytes.take(frame.data.data(), frame.data.size());
  frame.id = (how & 0x80) != 0 ? bytes.take<std::uint32_t>() : layout.id;
  frame.extended = (how & 0x40) != 0;
  frame.length = (how & 0x20) != 0 ? static_cast<std::uint8_t>(how & 0x0F) : 8;
  if ((how & 0x10) != 0) frame.data[0] = plainCrc(frame, layout.data_id);
  return frame;
}

// Up to three wrong bits, a wrong length or another's identifier: a right frame is right no more.
void damage(FuzzBytes& bytes, std::size_t which, const Frame& frame) {
  Frame wrong = frame;
  for (std::size_t i = bytes.choice(4); i-- > 0;) {
    const std::size_t bit = bytes.choice(64);
    wrong.data[bit / 8] = static_cast<std::uint8_t>(wrong.data[bit / 8] ^ 1u << bit % 8);
  }
  require(wrong.data == frame.data || !check(which, wrong), "up to three wrong bits are found");
  Frame other = frame;
  const std::size_t stranger = (which + 1 + bytes.choice(8)) % 9;
  other.id = frameLayouts()[stranger].id;
  require(!check(which, other) && !check(stranger, other), "no frame passes as another");
}

// The rule of the stream's check, written down as the last ten receptions.
class Receptions {
 public:
  void add(bool right) { wrong_ = (wrong_ << 1 | (right ? 0u : 1u)) & 0x3FF; }
  bool faulty() const { return __builtin_popcount(wrong_) >= 3; }

 private:
  unsigned wrong_ = 0;
};

void decodeFrames(FuzzBytes& bytes) {
  StreamCheck stream;
  Receptions receptions;
  std::optional<int> last;
  const std::size_t which = bytes.choice(9);
  while (!bytes.empty()) {
    const Frame frame = takeFrame(bytes, which);
    const std::optional<std::uint8_t> counter = check(which, frame);
    if (counter) {
      const bool follows = !last || *counter == (*last + 1) % 15 || *counter == (*last + 2) % 15;
      require(stream.accept(*counter) == follows, "counters go on by one or two");
      receptions.add(follows);
      last = *counter;
      damage(bytes, which, frame);
    } else {
      stream.reject();
      receptions.add(false);
    }
    require(stream.faulty() == receptions.faulty(), "three of ten wrong are a fault");
  }
}

void readKernelFrame(FuzzBytes& bytes) {
  can_frame raw{};
  bytes.take(&raw, sizeof raw);
  const std::optional<Frame> frame = fromLinux(raw);
  const bool data = (raw.can_id & (CAN_RTR_FLAG | CAN_ERR_FLAG)) == 0;
  const bool fits = (raw.can_id & CAN_EFF_FLAG) != 0 || (raw.can_id & CAN_EFF_MASK) <= CAN_SFF_MASK;
  require(frame.has_value() == (data && fits && raw.can_dlc <= 8),
          "data frames are read, and no others");
  if (!frame) return;
  const can_frame back = toLinux(*frame);
  require(back.can_id == raw.can_id && back.can_dlc == raw.can_dlc, "identifier and length go through");
  require(std::memcmp(back.data, raw.data, raw.can_dlc) == 0, "bytes go through");
  for (std::size_t which = 0; which < frameLayouts().size(); ++which) check(which, *frame);
}

bool near(double a, double b, double step) { return std::abs(a - b) <= 0.5001 * step; }

// Any numbers at all: what is encoded comes back within half a step.
void encodeNumbers(FuzzBytes& bytes) {
  constexpr double kDegree = 0.017453292519943295;
  TruckCommandFrame command;
  command.counter = bytes.take<std::uint8_t>();
  command.mode = bytes.take<std::uint8_t>();
  command.reason = bytes.take<std::uint8_t>();
  command.articulation_angle = bytes.take<double>();
  command.speed = bytes.take<double>();
  command.acceleration = bytes.take<double>();
  if (const std::optional<Frame> frame = encode(command)) {
    const auto back = decode<TruckCommandFrame>(*frame);
    require(back.has_value(), "what was encoded is decoded");
    require(near(back->articulation_angle, command.articulation_angle, 0.01 * kDegree), "angle");
    require(near(back->speed, command.speed, 0.001), "speed");
    require(near(back->acceleration, command.acceleration, 0.025), "acceleration");
    require(back->counter == command.counter && back->mode == command.mode, "counter and mode");
  }
  TruckStatusFrame status;
  status.operator_key = command.mode;
  status.payload = bytes.take<double>();
  status.brake_pressure = bytes.take<double>();
  if (const std::optional<Frame> frame = encode(status)) {
    const auto back = decode<TruckStatusFrame>(*frame);
    require(back.has_value(), "what was encoded is decoded");
    require(near(back->payload, status.payload, 2.0), "payload");
    require(near(back->brake_pressure, status.brake_pressure, 500.0), "pressure");
  }
}

}  // namespace
}  // namespace tunnel_pilot::can

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunnel_pilot::FuzzBytes bytes(data, size);
  switch (bytes.choice(4)) {
    case 0:
      tunnel_pilot::can::decodeFrames(bytes);
      break;
    case 1:
      tunnel_pilot::can::readKernelFrame(bytes);
      break;
    case 2:
      tunnel_pilot::can::encodeNumbers(bytes);
      break;
    default:
      tunnel_pilot::can::fuzzJ1939(bytes);
      break;
  }
  return 0;
}
