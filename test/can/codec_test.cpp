#include "tunnel_pilot/can/codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace tunnel_pilot::can {
namespace {

constexpr double kDeg = 3.14159265358979323846 / 180.0;
using Signals = std::map<std::string, double>;  // in the units of the wire

// One vector of vectors.csv, made by cantools.
struct Vector {
  bool encode = false;
  std::string name;
  Frame frame;
  Signals signals;
};

Frame parseFrame(const std::string& name, const std::string& hex) {
  Frame frame;
  frame.length = static_cast<std::uint8_t>(hex.size() / 2);
  for (std::size_t i = 0; i < frame.length; ++i) {
    frame.data[i] = static_cast<std::uint8_t>(std::stoi(hex.substr(2 * i, 2), nullptr, 16));
  }
  for (const FrameLayout& layout : frameLayouts()) {
    if (name == layout.name) frame.id = layout.id;
  }
  return frame;
}

std::vector<Vector> readVectors() {
  std::ifstream file(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/test/can/vectors.csv");
  std::vector<Vector> vectors;
  for (std::string line; std::getline(file, line);) {
    std::istringstream cells(line);
    std::string kind, hex, cell;
    Vector vector;
    std::getline(cells, kind, ',');
    std::getline(cells, vector.name, ',');
    std::getline(cells, hex, ',');
    vector.encode = kind == "encode";
    vector.frame = parseFrame(vector.name, hex);
    while (std::getline(cells, cell, ',')) {
      const std::size_t equals = cell.find('=');
      vector.signals[cell.substr(0, equals)] = std::stod(cell.substr(equals + 1));
    }
    vectors.push_back(vector);
  }
  return vectors;
}

// Both ways between the signals by name and the structs, written by hand apart from the codec.
struct Fill {
  const Signals& signals;
  template <class T>
  void operator()(T& field, const char* name, double unit = 1.0) const {
    field = static_cast<T>(signals.at(name) * unit);
  }
};
struct Expect {
  const Signals& signals;
  template <class T>
  void operator()(const T& field, const char* name, double unit = 1.0) const {
    EXPECT_NEAR(static_cast<double>(field), signals.at(name) * unit, 1e-9) << name;
  }
};

template <class V>
void names(const V& v, TruckCommandFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.steering_enable, "SteeringEnable");
  v(f.stop, "Stop");
  v(f.mode, "Mode");
  v(f.articulation_angle, "ArticulationAngle", kDeg);
  v(f.speed, "Speed");
  v(f.acceleration, "Acceleration");
  v(f.reason, "Reason");
}
template <class V>
void names(const V& v, CommandInfoFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.source, "Source");
  v(f.measurement_stamp_ms, "MeasurementStamp");
  v(f.sequence, "Sequence");
}
template <class V>
void names(const V& v, BridgeStatusFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.state, "State");
  v(f.reason, "Reason");
  v(f.feedback_age, "FeedbackAge", 1e-3);
  v(f.frames_rejected, "FramesRejected");
  v(f.commands_rejected, "CommandsRejected");
}
template <class V>
void names(const V& v, TruckFeedbackFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.autonomy_enabled, "AutonomyEnabled");
  v(f.operator_enable, "OperatorEnable");
  v(f.operator_override, "OperatorOverride");
  v(f.fault, "Fault");
  v(f.articulation_angle, "ArticulationAngle", kDeg);
  v(f.articulation_rate, "ArticulationRate", kDeg);
  v(f.speed, "Speed");
}
template <class V>
void names(const V& v, TruckMotionFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.front_axle_speed, "FrontAxleSpeed");
  v(f.rear_axle_speed, "RearAxleSpeed");
  v(f.acceleration, "Acceleration");
  v(f.yaw_rate, "YawRate", kDeg);
}
template <class V>
void names(const V& v, TruckStatusFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.operator_key, "OperatorKey");
  v(f.faults, "Faults");
  v(f.payload, "Payload");
  v(f.brake_pressure, "BrakePressure", 1000.0);
}
template <class V>
void names(const V& v, OperatorFrame& f) {
  v(f.counter, "AliveCounter");
  v(f.steering_wheel, "SteeringWheel", kDeg);
  v(f.steering_wheel_rate, "SteeringWheelRate", kDeg);
  v(f.throttle, "Throttle", 0.01);
  v(f.brake, "Brake", 0.01);
}
template <class V>
void names(const V& v, Coils1Frame& f) {
  const char* coils[] = {"Coil1", "Coil2", "Coil3", "Coil4"};
  v(f.counter, "AliveCounter");
  for (std::size_t i = 0; i < 4; ++i) v(f.coils[i], coils[i]);
}
template <class V>
void names(const V& v, Coils2Frame& f) {
  const char* coils[] = {"Coil5", "Coil6", "Coil7"};
  v(f.counter, "AliveCounter");
  for (std::size_t i = 0; i < 3; ++i) v(f.coils[i], coils[i]);
}

template <class Fields>
void checkVector(const Vector& vector) {
  Fields fields;
  if (vector.encode) {
    names(Fill{vector.signals}, fields);
  } else {
    const std::optional<Fields> decoded = decode<Fields>(vector.frame);
    ASSERT_TRUE(decoded);
    fields = *decoded;
    names(Expect{vector.signals}, fields);
  }
  const std::optional<Frame> frame = encode(fields);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->data, vector.frame.data);
  EXPECT_EQ(frame->id, vector.frame.id);
}

const std::map<std::string, std::function<void(const Vector&)>> kChecks = {
    {"TP_COMMAND", checkVector<TruckCommandFrame>},  {"TP_COMMAND_INFO", checkVector<CommandInfoFrame>},
    {"TP_STATUS", checkVector<BridgeStatusFrame>},   {"TRUCK_FEEDBACK", checkVector<TruckFeedbackFrame>},
    {"TRUCK_MOTION", checkVector<TruckMotionFrame>}, {"TRUCK_STATUS", checkVector<TruckStatusFrame>},
    {"OPERATOR", checkVector<OperatorFrame>},        {"COILS_1", checkVector<Coils1Frame>},
    {"COILS_2", checkVector<Coils2Frame>},
};

TEST(Codec, AgreesWithCantoolsBitForBit) {
  const std::vector<Vector> vectors = readVectors();
  ASSERT_GE(vectors.size(), 800u);
  std::map<std::string, int> seen;
  for (const Vector& vector : vectors) {
    SCOPED_TRACE(vector.name + " vector " + std::to_string(seen[vector.name]++));
    kChecks.at(vector.name)(vector);
  }
  EXPECT_EQ(seen.size(), frameLayouts().size());
}

TEST(Codec, RefusesWhatIsNotFinite) {
  for (double bad : {std::nan(""), std::numeric_limits<double>::infinity(),
                     -std::numeric_limits<double>::infinity()}) {
    TruckCommandFrame angle;
    angle.articulation_angle = bad;
    EXPECT_FALSE(encode(angle));
    TruckCommandFrame speed;
    speed.speed = bad;
    EXPECT_FALSE(encode(speed));
    TruckMotionFrame gyro;
    gyro.yaw_rate = bad;
    EXPECT_FALSE(encode(gyro));
  }
}

TEST(Codec, RefusesOutOfRangeInsteadOfWrapping) {
  const auto withAngle = [](double degrees) {
    TruckCommandFrame frame;
    frame.articulation_angle = degrees * kDeg;
    return encode(frame);
  };
  EXPECT_TRUE(withAngle(45.0));
  EXPECT_TRUE(withAngle(-45.0));
  EXPECT_FALSE(withAngle(45.01));
  EXPECT_FALSE(withAngle(-45.01));
  EXPECT_FALSE(withAngle(655.36 + 10.0));  // would wrap to 10 degrees
  EXPECT_FALSE(withAngle(1e300));
  TruckCommandFrame counter;
  counter.counter = 15;
  EXPECT_FALSE(encode(counter));
}

TEST(Codec, RefusesWrongLengthIdentifierAndFormat) {
  const Frame good = *encode(TruckFeedbackFrame());
  ASSERT_TRUE(decode<TruckFeedbackFrame>(good));
  for (int length = 0; length <= 255; ++length) {
    Frame frame = good;
    frame.length = static_cast<std::uint8_t>(length);
    EXPECT_EQ(decode<TruckFeedbackFrame>(frame).has_value(), length == 8);
  }
  Frame extended = good;
  extended.extended = true;
  EXPECT_FALSE(decode<TruckFeedbackFrame>(extended));
  Frame other = good;
  other.id = kTruckMotionId;
  EXPECT_FALSE(decode<TruckFeedbackFrame>(other));
}

TEST(Codec, RefusesAFrameUnderAnotherFramesIdentifier) {
  Frame frame = *encode(TruckFeedbackFrame());
  frame.id = kTruckMotionId;
  EXPECT_FALSE(decode<TruckMotionFrame>(frame)) << "the DataId must tell them apart";
}

TEST(Codec, RefusesASignalOutsideItsRangeThoughTheCrcIsRight) {
  Frame frame = *encode(TruckFeedbackFrame());
  frame.data[2] = 0x00;
  frame.data[3] = 0x20;  // 0x2000 = 81.92 degrees
  frame.data[0] = frameCrc(*findLayout(frame.id), frame);
  EXPECT_FALSE(decode<TruckFeedbackFrame>(frame));
}

}  // namespace
}  // namespace tunnel_pilot::can
