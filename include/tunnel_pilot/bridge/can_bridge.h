#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/bridge/command_sender.h"
#include "tunnel_pilot/bridge/odometry.h"
#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/bridge/steering_watch.h"
#include "tunnel_pilot/bridge/transmit_watch.h"
#include "tunnel_pilot/bridge/truck_link.h"
#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/geometry/tick_time.h"
#include "tunnel_pilot/supervision/command.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::bridge {

/// What the bridge tells about the truck and itself (the content of TruckStatus.msg, and some figures).
struct BridgeStatus {
  Stamp stamp{};
  SafetyState state = SafetyState::kInit;
  supervision::Reason reason = supervision::Reason::kStartUp;  ///< of the last change of state
  std::uint32_t transitions = 0;                               ///< changes of state so far
  bool autonomy_enabled = false;                               ///< the truck's controller obeys
  bool operator_enable = false;  ///< the operator's key is turned to autonomous
  bool operator_override = false;
  std::uint16_t faults = 0;                ///< can::TruckFault bits
  double steering_wheel = 0.0;             ///< [rad]
  double throttle_pedal = 0.0;             ///< [1]
  double brake_pedal = 0.0;                ///< [1]
  double brake_pressure = 0.0;             ///< [Pa]
  double payload = 0.0;                    ///< [kg]
  double yaw_rate = 0.0;                   ///< gyro as measured [rad/s]
  double longitudinal_acceleration = 0.0;  ///< [m/s^2]
  std::array<double, 7> coils{};           ///< [1]
  double feedback_age = 0.0;    ///< of the oldest of the truck's three frames, infinite before [s]
  double command_age = 0.0;     ///< since the last accepted command, infinite before [s]
  double tracking_error = 0.0;  ///< outside of what the steering response explains [rad]
  std::uint32_t frames_received = 0;
  std::uint32_t frames_rejected = 0;
  std::uint32_t frames_sent = 0;
  std::uint32_t commands_rejected = 0;
  std::string command_rejection;  ///< why the last rejected command was
};

/// Between the arbiter and the truck: sends the command frames, watches everything that must be alive,
/// and owns the safety state (transitionTable()). The arbiter asks, the bridge decides, and it believes
/// nothing unchecked. Time is injected; no call throws or blocks after construction.
///
/// Every frame_period the last command is sent again with a new alive counter; steering is enabled only
/// in ACTIVE, DEGRADED and a STOPPING that came of them, and only while the truck's frames are fresh and
/// the operator has not taken over. A stop brakes while it steers: along the arbiter's command while
/// that is fresh, otherwise it holds the articulation measured when it ceased to be. The last stage
/// before the bus limits the angle's lateral acceleration and its rate, from the angle measured when
/// steering was enabled. A stop is told within the call that asks for it.
///
/// When frames are not proven to be sent in time, or the bus is off, nothing is written any more and the
/// bus is asked to discard what it holds, again and again, until it works: no frame is sent late.
class CanBridge {
 public:
  CanBridge(const BridgeParameters& parameters, const vehicle::TruckGeometry& truck, can::Bus& bus);

  /// Takes the arbiter's command as received at `now`. Not finite, out of range, from the future or
  /// numbered lower than before: refused and counted; if it asks for a stop, the stop counts all the
  /// same.
  void setCommand(const supervision::Command& command, Stamp now);

  /// Refuses a command for a reason of the caller's, as setCommand() refuses one.
  void rejectCommand(const supervision::Command& command, std::string_view why, Stamp now);

  /// Which of the pilot's processes gives no sign of life (HeartbeatWatch); none: all do. Asked of
  /// before each tick.
  void setSilentProcess(std::optional<std::string> process) { silent_process_ = std::move(process); }

  /// Drains the bus, watches, runs the table, integrates odometry, sends what is due. Call at 50 Hz or
  /// more. A `now` before the last one is a clock that jumped.
  void tick(Stamp now);

  /// An operator's edge and its answer; the reason says why not.
  struct Answer {
    bool accepted = false;
    std::string reason;
  };
  Answer engage(Stamp now);
  Answer release(Stamp now);  ///< brakes to a stop when driving
  Answer stop(Stamp now);
  Answer reset(Stamp now);  ///< leaves STOPPED

  /// The caller found that its clock does not go on from where it was: all ages are void.
  void clockJumped(Stamp now);

  const drivers::Motion& motion() const { return odometry_.motion(); }
  const Odometry& odometry() const { return odometry_; }
  bool motionFresh(Stamp now) const { return link_.fresh(now); }
  const BridgeStatus& status() const { return status_; }

 private:
  struct Received {
    supervision::Command command;
    Stamp at{};
  };

  // what is wrong, gravest first; nullopt: nothing
  std::optional<Event> linkFault(Stamp now) const;
  std::optional<Event> truckFault() const;
  std::optional<Event> commandFault(Stamp now) const;
  std::optional<Event> drivingFault(Stamp now) const;
  std::optional<Event> anyFault(Stamp now) const;
  std::optional<Event> degradation(Stamp now) const;

  std::string_view whyRefused(const supervision::Command& command, Stamp now) const;
  std::uint32_t monotonous(std::uint32_t sequence);
  void listen(Stamp now);
  void clearBus(Stamp now);
  bool busFaulty() const;
  void advance(Stamp now);
  void watchInputs(Stamp now);
  void watchProgress(Stamp now);
  void watchSteering(Stamp now);
  void raise(Event event, Stamp now);
  void raise(Event event, Stamp now, supervision::Reason carried);
  std::string inWords(Event fault) const;
  std::optional<std::string> whyUnhealthy(Stamp now) const;

  bool standsStill(Stamp now) const;
  bool commandUsable(Stamp now) const;
  bool steeringEnabled(Stamp now) const;
  bool tooOldOnTheBus(Stamp now) const;
  bool stopBit(Stamp now) const;
  double limitedAngle(double wanted, bool steering);
  double widestAngle() const;
  void sendIfDue(Stamp now);
  can::TruckCommandFrame composeCommand(Stamp now);
  can::CommandInfoFrame composeInfo(Stamp now) const;
  can::BridgeStatusFrame composeStatus(Stamp now) const;
  void updateStatus(Stamp now);

  BridgeParameters parameters_;
  vehicle::TruckGeometry truck_;
  double max_angle_;  ///< of a command [rad]
  can::Bus& bus_;
  TruckLink link_;
  CommandSender sender_;
  TransmitWatch transmit_;
  Odometry odometry_;
  SteeringWatch watch_;
  BridgeStatus status_;

  std::optional<Received> command_;
  std::optional<std::string> silent_process_;
  std::uint32_t sequence_offset_ = 0;  ///< added to the arbiter's numbers, so that they never decrease
  Stamp last_tick_{};
  TickTime tick_time_;
  Stamp entered_{};                        ///< the present state
  std::optional<Stamp> asked_to_discard_;  ///< since the bus last worked
  std::uint64_t confirmed_in_fault_ = 0;   ///< frames, when the bus last failed
  std::optional<Stamp> link_healthy_since_;
  std::optional<Stamp> healthy_since_;     ///< all inputs
  std::optional<Stamp> undegraded_since_;  ///< what leads into DEGRADED ends it
  Stamp obeyed_{};  ///< when the truck last told that it obeys, or was first asked to
  std::optional<Stamp> standing_since_;
  std::optional<double> held_angle_;  ///< of a stop without a usable command [rad]
  double sent_angle_ = 0.0;           ///< [rad]
  Stamp sent_at_{};                   ///< the last set, by tick_time_
  bool stop_steers_ = false;          ///< the stop began while driving
  bool steering_sent_ = false;        ///< the last frame had steering enabled
};

}  // namespace tunnel_pilot::bridge
