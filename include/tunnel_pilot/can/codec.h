#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "tunnel_pilot/can/frame.h"
#include "tunnel_pilot/can/layout.h"

namespace tunnel_pilot::can {

// One struct for each frame of config/tunnel_pilot.dbc, in SI units. Degrees, kPa and per cent exist
// only inside the codec. Enumerations stay numbers here (the rooms above know their names).

/// TP_COMMAND: what the truck shall do.
struct TruckCommandFrame {
  std::uint8_t counter = 0;
  bool steering_enable = false;
  bool stop = false;
  std::uint8_t mode = 0;            ///< supervision::Mode
  double articulation_angle = 0.0;  ///< [rad]
  double speed = 0.0;               ///< [m/s]
  double acceleration = 0.0;        ///< [m/s^2]
  std::uint8_t reason = 0;          ///< supervision::Reason
};

/// TP_COMMAND_INFO: where the command stems from.
struct CommandInfoFrame {
  std::uint8_t counter = 0;
  std::uint8_t source = 0;                 ///< supervision::Source
  std::uint16_t measurement_stamp_ms = 0;  ///< [ms] modulo 65536
  std::uint32_t sequence = 0;
};

/// TP_STATUS: the bridge's safety state.
struct BridgeStatusFrame {
  std::uint8_t counter = 0;
  std::uint8_t state = 0;     ///< bridge::SafetyState
  std::uint8_t reason = 0;    ///< supervision::Reason of the last change of state
  double feedback_age = 0.0;  ///< [s], at most 0.255
  std::uint16_t frames_rejected = 0;
  std::uint16_t commands_rejected = 0;
};

/// TRUCK_FEEDBACK.
struct TruckFeedbackFrame {
  std::uint8_t counter = 0;
  bool autonomy_enabled = false;
  bool operator_enable = false;
  bool operator_override = false;
  bool fault = false;
  double articulation_angle = 0.0;  ///< [rad]
  double articulation_rate = 0.0;   ///< [rad/s]
  double speed = 0.0;               ///< [m/s]
};

/// TRUCK_MOTION.
struct TruckMotionFrame {
  std::uint8_t counter = 0;
  double front_axle_speed = 0.0;  ///< [m/s]
  double rear_axle_speed = 0.0;   ///< [m/s]
  double acceleration = 0.0;      ///< [m/s^2]
  double yaw_rate = 0.0;          ///< gyro [rad/s]
};

enum class OperatorKey : std::uint8_t { kOff = 0, kManual = 1, kAutonomous = 2 };

/// TRUCK_STATUS.
struct TruckStatusFrame {
  std::uint8_t counter = 0;
  std::uint8_t operator_key = 0;  ///< OperatorKey
  std::uint16_t faults = 0;       ///< TruckFault bits
  double payload = 0.0;           ///< [kg]
  double brake_pressure = 0.0;    ///< [Pa]
};

/// Bits of TruckStatusFrame::faults.
enum TruckFault : std::uint16_t {
  kFaultCommandTimeout = 1u << 0,
  kFaultCommandCorrupt = 1u << 1,
  kFaultSteering = 1u << 2,
  kFaultBrake = 1u << 3,
  kFaultSensor = 1u << 4,
  kFaultEngine = 1u << 5,
};

/// OPERATOR: wheel and pedals.
struct OperatorFrame {
  std::uint8_t counter = 0;
  double steering_wheel = 0.0;       ///< [rad], positive turns left
  double steering_wheel_rate = 0.0;  ///< [rad/s]
  double throttle = 0.0;             ///< [1] 0..1
  double brake = 0.0;                ///< [1] 0..1
};

/// COILS_1 and COILS_2: amplitudes over full scale of the wire guidance coils 1-4 and 5-7 [1].
struct Coils1Frame {
  std::uint8_t counter = 0;
  std::array<double, 4> coils{};
};
struct Coils2Frame {
  std::uint8_t counter = 0;
  std::array<double, 3> coils{};
};

/// Writes a struct as a frame, with its CRC. nullopt when a number is not finite or its nearest raw
/// value lies outside the range of the .dbc: nothing is clamped and nothing wraps.
template <class Fields>
std::optional<Frame> encode(const Fields& fields);

/// Reads a frame. nullopt when identifier, length or CRC are wrong, or a signal lies outside its range.
/// Never throws, whatever the bytes.
template <class Fields>
std::optional<Fields> decode(const Frame& frame);

/// CRC that a frame of this identifier must carry in byte 0 (bytes 1..7, then the DataId).
std::uint8_t frameCrc(const FrameLayout& layout, const Frame& frame);

}  // namespace tunnel_pilot::can
