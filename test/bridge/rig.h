#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/simulation/truck_controller.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

namespace tunnel_pilot::bridge {

inline Stamp ms(double milliseconds) { return fromSeconds(milliseconds * 1e-3); }

/// Judges every frame that leaves the bridge by the definition of an unsafe frame (RELIABILITY, section
/// 1), from the frames themselves and the rig's knowledge of what happened.
class Judge {
 public:
  void frame(const can::Frame& frame, const BridgeStatus& status, Stamp last_feedback, Stamp now);
  void stopAsked(Stamp now);

  std::vector<std::string> complaints;
  std::optional<can::TruckCommandFrame> last;
  std::optional<can::CommandInfoFrame> last_info;
  std::vector<can::TruckCommandFrame> commands;
  std::vector<Stamp> times;

 private:
  void command(const can::Frame& frame, const BridgeStatus& status, Stamp last_feedback, Stamp now);
  void complain(const std::string& what, Stamp now);

  std::optional<Stamp> stop_asked_;
};

/// The bridge, the truck's controller and a kinematic truck in closed loop, the rig between them as the
/// wire. Time runs in steps of 1 ms from an odd start.
class Rig {
 public:
  explicit Rig(double tick_period = 0.005);

  /// With a bus of one's own between the bridge and its end of the wire.
  using MakeBus = std::function<std::unique_ptr<can::Bus>(can::Bus& wire)>;
  Rig(double tick_period, const MakeBus& make_bus);

  /// With both sides on this profile. The wire, `log` and the filters on it have its identifiers; the
  /// judge is given those of 11 bits.
  Rig(double tick_period, can::ProfileKind profile);

  /// Runs for a time [s]; `until` ends it early (looked at every ms).
  void run(
      double seconds, const std::function<bool()>& until = [] { return false; });

  /// Carries what waits over the wire. run() does it; an operator's call outside of it should be
  /// followed by one, so that its frames carry their own time.
  void pump();

  /// From power-up to ACTIVE (or to where `speed` [m/s] is reached).
  void drive(double speed = 3.0);

  SafetyState state() const { return bridge->status().state; }
  supervision::Reason reason() const { return bridge->status().reason; }

  /// The bridge's clock, and the arbiter's: `now`, until it jumps.
  Stamp clock() const { return now + jumped_; }

  /// Lets that clock jump and tells the bridge; what it sends is carried.
  void jump(Stamp by);

  /// Runs until the bridge has just sent a set of frames, or just had a tick; at most 50 ms.
  void runToSet();
  void runToTick();

  /// Runs until the state is STOPPING, at most `seconds`; returns how long it took [s].
  double timeToStop(double seconds = 3.0);

  static BridgeParameters bridgeParameters();
  static vehicle::TruckParameters truckParameters();

  Stamp now = fromSeconds(1234.5678901);
  double tick_period;
  supervision::Command command;      ///< what the arbiter says every 20 ms
  Stamp measurement_age = ms(60);    ///< of its measurement
  std::optional<Stamp> measurement;  ///< a fixed one instead
  bool arbiter_alive = true;
  bool truck_alive = true;
  bool valve_stuck = false;
  double gyro_bias = 0.0;  ///< [rad/s]
  simulation::OperatorInputs cab;
  std::function<std::optional<can::Frame>(can::Frame)> to_bridge = [](const can::Frame& f) {
    return std::optional<can::Frame>(f);
  };
  std::function<std::optional<can::Frame>(can::Frame)> to_truck = to_bridge;

  can::ProfileKind profile = can::ProfileKind::kPlain;
  can::MemoryBusHub bridge_side, truck_side;
  std::unique_ptr<can::Bus> bridge_end, bridge_bus, truck_bus, wire_to_bridge, wire_to_truck;
  std::unique_ptr<CanBridge> bridge;
  std::unique_ptr<simulation::TruckController> controller;
  vehicle::KinematicTruck plant;
  Judge judge;
  Stamp last_command{};         ///< when the bridge last got one
  Stamp last_feedback{};        ///< when the bridge could last hear a good TRUCK_FEEDBACK
  std::vector<can::Frame> log;  ///< all frames, both ways

 private:
  Rig(double tick_period, const MakeBus& make_bus, can::ProfileKind profile);
  can::Frame plain(can::Frame frame) const;
  void step();
  void sendCommand();
  void moveTruck();

  Stamp next_tick_, next_command_;
  Stamp jumped_{};
  std::uint32_t sequence_ = 0;
};

}  // namespace tunnel_pilot::bridge
