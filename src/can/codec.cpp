#include "tunnel_pilot/can/codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tunnel_pilot/can/protection.h"

namespace tunnel_pilot::can {
namespace {

constexpr std::uint8_t kFrameLength = 8;
constexpr double kPi = 3.14159265358979323846;

/// SI value of one unit of the wire.
double siPerUnit(const char* unit) {
  if (std::strcmp(unit, "deg") == 0 || std::strcmp(unit, "deg/s") == 0) return kPi / 180.0;
  if (std::strcmp(unit, "kPa") == 0) return 1000.0;
  if (std::strcmp(unit, "%") == 0) return 0.01;
  if (std::strcmp(unit, "ms") == 0) return 0.001;
  return 1.0;
}

/// The frame's eight bytes as one little-endian number, in which a signal is a run of bits.
std::uint64_t toBits(const std::array<std::uint8_t, 8>& data) {
  std::uint64_t bits = 0;
  for (int i = 7; i >= 0; --i) bits = (bits << 8) | data[static_cast<std::size_t>(i)];
  return bits;
}

std::uint64_t maskOf(const SignalLayout& signal) {
  return (std::uint64_t{1} << signal.length) - 1;  // no signal is 64 bits long
}

bool inRange(const SignalLayout& signal, std::int64_t raw) {
  return raw >= std::llround(signal.min / signal.factor) &&
         raw <= std::llround(signal.max / signal.factor);
}

/// Takes the fields in the order of the layout and sets their bits.
class Writer {
 public:
  explicit Writer(const FrameLayout& layout) : signal_(layout.signals.data() + 1) {}

  void operator()(double value) {
    const SignalLayout& signal = *signal_++;
    const double raw = value / siPerUnit(signal.unit) / signal.factor;
    if (!std::isfinite(raw) || std::abs(raw) > 4.3e9) {  // beyond any signal: llround is safe below
      good_ = false;
      return;
    }
    put(signal, std::llround(raw));
  }
  template <class Integer>
  void operator()(Integer value) {
    put(*signal_++, static_cast<std::int64_t>(value));
  }

  bool good() const { return good_; }
  std::uint64_t bits() const { return bits_; }

 private:
  void put(const SignalLayout& signal, std::int64_t raw) {
    if (!inRange(signal, raw)) good_ = false;
    bits_ |= (static_cast<std::uint64_t>(raw) & maskOf(signal)) << signal.start;
  }

  const SignalLayout* signal_;
  std::uint64_t bits_ = 0;
  bool good_ = true;
};

/// Takes the fields in the order of the layout and fills them from the bits.
class Reader {
 public:
  Reader(const FrameLayout& layout, std::uint64_t bits)
      : signal_(layout.signals.data() + 1), bits_(bits) {}

  void operator()(double& value) {
    const SignalLayout& signal = *signal_;
    value = static_cast<double>(get()) * signal.factor * siPerUnit(signal.unit);
  }
  template <class Integer>
  void operator()(Integer& value) {
    value = static_cast<Integer>(get());
  }

  bool good() const { return good_; }

 private:
  std::int64_t get() {
    const SignalLayout& signal = *signal_++;
    auto raw = static_cast<std::int64_t>((bits_ >> signal.start) & maskOf(signal));
    const std::int64_t sign_bit = std::int64_t{1} << (signal.length - 1);
    if (signal.is_signed && (raw & sign_bit) != 0) raw -= 2 * sign_bit;
    if (!inRange(signal, raw)) good_ = false;
    return raw;
  }

  const SignalLayout* signal_;
  std::uint64_t bits_;
  bool good_ = true;
};

/// Identifier of each struct and its fields in the order of the layout, counter first.
template <class Fields>
struct Description;

template <>
struct Description<TruckCommandFrame> {
  static constexpr std::uint32_t kId = kTpCommandId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.steering_enable), v(f.stop), v(f.mode), v(f.articulation_angle), v(f.speed),
        v(f.acceleration), v(f.reason);
  }
};

template <>
struct Description<CommandInfoFrame> {
  static constexpr std::uint32_t kId = kTpCommandInfoId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.source), v(f.measurement_stamp_ms), v(f.sequence);
  }
};

template <>
struct Description<BridgeStatusFrame> {
  static constexpr std::uint32_t kId = kTpStatusId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.state), v(f.reason), v(f.feedback_age), v(f.frames_rejected),
        v(f.commands_rejected);
  }
};

template <>
struct Description<TruckFeedbackFrame> {
  static constexpr std::uint32_t kId = kTruckFeedbackId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.autonomy_enabled), v(f.operator_enable), v(f.operator_override), v(f.fault),
        v(f.articulation_angle), v(f.articulation_rate), v(f.speed);
  }
};

template <>
struct Description<TruckMotionFrame> {
  static constexpr std::uint32_t kId = kTruckMotionId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.front_axle_speed), v(f.rear_axle_speed), v(f.acceleration), v(f.yaw_rate);
  }
};

template <>
struct Description<TruckStatusFrame> {
  static constexpr std::uint32_t kId = kTruckStatusId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.operator_key), v(f.faults), v(f.payload), v(f.brake_pressure);
  }
};

template <>
struct Description<OperatorFrame> {
  static constexpr std::uint32_t kId = kOperatorId;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter), v(f.steering_wheel), v(f.steering_wheel_rate), v(f.throttle), v(f.brake);
  }
};

template <>
struct Description<Coils1Frame> {
  static constexpr std::uint32_t kId = kCoils1Id;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter);
    for (auto& coil : f.coils) v(coil);
  }
};

template <>
struct Description<Coils2Frame> {
  static constexpr std::uint32_t kId = kCoils2Id;
  template <class Visitor, class F>
  static void visit(Visitor& v, F& f) {
    v(f.counter);
    for (auto& coil : f.coils) v(coil);
  }
};

}  // namespace

std::uint8_t frameCrc(const FrameLayout& layout, const Frame& frame) {
  std::array<std::uint8_t, 8> bytes{};
  std::copy(frame.data.begin() + 1, frame.data.end(), bytes.begin());
  bytes[7] = layout.data_id;
  return crc8(bytes.data(), bytes.size());
}

template <class Fields>
std::optional<Frame> encode(const Fields& fields) {
  const FrameLayout& layout = *findLayout(Description<Fields>::kId);
  Writer writer(layout);
  Description<Fields>::visit(writer, fields);
  if (!writer.good()) return std::nullopt;
  Frame frame;
  frame.id = layout.id;
  frame.length = kFrameLength;
  for (std::size_t i = 0; i < 8; ++i)
    frame.data[i] = static_cast<std::uint8_t>(writer.bits() >> (8 * i));
  frame.data[0] = frameCrc(layout, frame);
  return frame;
}

template <class Fields>
std::optional<Fields> decode(const Frame& frame) {
  const FrameLayout& layout = *findLayout(Description<Fields>::kId);
  if (frame.id != layout.id || frame.extended || frame.length != kFrameLength) return std::nullopt;
  if (frame.data[0] != frameCrc(layout, frame)) return std::nullopt;
  Fields fields;
  Reader reader(layout, toBits(frame.data));
  Description<Fields>::visit(reader, fields);
  if (!reader.good()) return std::nullopt;
  return fields;
}

template std::optional<Frame> encode(const TruckCommandFrame&);
template std::optional<Frame> encode(const CommandInfoFrame&);
template std::optional<Frame> encode(const BridgeStatusFrame&);
template std::optional<Frame> encode(const TruckFeedbackFrame&);
template std::optional<Frame> encode(const TruckMotionFrame&);
template std::optional<Frame> encode(const TruckStatusFrame&);
template std::optional<Frame> encode(const OperatorFrame&);
template std::optional<Frame> encode(const Coils1Frame&);
template std::optional<Frame> encode(const Coils2Frame&);
template std::optional<TruckCommandFrame> decode(const Frame&);
template std::optional<CommandInfoFrame> decode(const Frame&);
template std::optional<BridgeStatusFrame> decode(const Frame&);
template std::optional<TruckFeedbackFrame> decode(const Frame&);
template std::optional<TruckMotionFrame> decode(const Frame&);
template std::optional<TruckStatusFrame> decode(const Frame&);
template std::optional<OperatorFrame> decode(const Frame&);
template std::optional<Coils1Frame> decode(const Frame&);
template std::optional<Coils2Frame> decode(const Frame&);

}  // namespace tunnel_pilot::can
