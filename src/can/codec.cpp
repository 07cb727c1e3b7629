#include "tunnel_pilot/can/codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

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

/// A signal's layout with all that every frame would have to work out anew.
struct Signal {
  explicit Signal(const SignalLayout& layout)
      : start(layout.start),
        factor(layout.factor),
        si_per_unit(siPerUnit(layout.unit)),
        mask((std::uint64_t{1} << layout.length) - 1),  // no signal is 64 bits long
        sign_bit(layout.is_signed ? std::int64_t{1} << (layout.length - 1) : 0),
        min(std::llround(layout.min / layout.factor)),
        max(std::llround(layout.max / layout.factor)) {}

  bool holds(std::int64_t raw) const { return raw >= min && raw <= max; }

  int start;
  double factor;
  double si_per_unit;
  std::uint64_t mask;
  std::int64_t sign_bit;  ///< 0: unsigned
  std::int64_t min, max;  ///< raw
};

struct Coding {
  explicit Coding(std::uint32_t id)
      : layout(*findLayout(id)), payload(layout.signals.begin() + 1, layout.signals.end()) {}

  const FrameLayout& layout;
  std::vector<Signal> payload;  ///< the signals behind the CRC
};

/// Takes the fields in the order of the layout and sets their bits.
class Writer {
 public:
  explicit Writer(const Coding& coding) : signal_(coding.payload.data()) {}

  void operator()(double value) {
    const Signal& signal = *signal_++;
    const double raw = value / signal.si_per_unit / signal.factor;
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
  void put(const Signal& signal, std::int64_t raw) {
    if (!signal.holds(raw)) good_ = false;
    bits_ |= (static_cast<std::uint64_t>(raw) & signal.mask) << signal.start;
  }

  const Signal* signal_;
  std::uint64_t bits_ = 0;
  bool good_ = true;
};

/// Takes the fields in the order of the layout and fills them from the bits.
class Reader {
 public:
  Reader(const Coding& coding, std::uint64_t bits) : signal_(coding.payload.data()), bits_(bits) {}

  void operator()(double& value) {
    const Signal& signal = *signal_;
    value = static_cast<double>(get()) * signal.factor * signal.si_per_unit;
  }
  template <class Integer>
  void operator()(Integer& value) {
    value = static_cast<Integer>(get());
  }

  bool good() const { return good_; }

 private:
  std::int64_t get() {
    const Signal& signal = *signal_++;
    auto raw = static_cast<std::int64_t>((bits_ >> signal.start) & signal.mask);
    if ((raw & signal.sign_bit) != 0) raw -= 2 * signal.sign_bit;
    if (!signal.holds(raw)) good_ = false;
    return raw;
  }

  const Signal* signal_;
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

template <class Fields>
const Coding& codingOf() {
  static const Coding coding(Description<Fields>::kId);
  return coding;
}

}  // namespace

std::uint8_t frameCrc(const FrameLayout& layout, const Frame& frame) {
  std::array<std::uint8_t, 8> bytes{};
  std::copy(frame.data.begin() + 1, frame.data.end(), bytes.begin());
  bytes[7] = layout.data_id;
  return crc8(bytes.data(), bytes.size());
}

template <class Fields>
std::optional<Frame> encode(const Fields& fields) {
  const Coding& coding = codingOf<Fields>();
  Writer writer(coding);
  Description<Fields>::visit(writer, fields);
  if (!writer.good()) return std::nullopt;
  Frame frame;
  frame.id = coding.layout.id;
  frame.length = kFrameLength;
  for (std::size_t i = 0; i < 8; ++i)
    frame.data[i] = static_cast<std::uint8_t>(writer.bits() >> (8 * i));
  frame.data[0] = frameCrc(coding.layout, frame);
  return frame;
}

template <class Fields>
std::optional<Fields> decode(const Frame& frame) {
  const Coding& coding = codingOf<Fields>();
  if (frame.id != coding.layout.id || frame.extended || frame.length != kFrameLength)
    return std::nullopt;
  if (frame.data[0] != frameCrc(coding.layout, frame)) return std::nullopt;
  Fields fields;
  Reader reader(coding, toBits(frame.data));
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
