#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/can/protection.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/vehicle/plant.h"

namespace tunnel_pilot::simulation {

/// All values of config/truck_controller.yaml.
struct TruckControllerParameters {
  double frame_period;          ///< of the frames it sends [s]
  double command_timeout;       ///< without a valid TP_COMMAND [s]
  double drive_acceleration;    ///< highest [m/s^2]
  double service_deceleration;  ///< highest while driving [m/s^2]
  double stop_deceleration;     ///< of a stop and of every brake to standstill [m/s^2]
  double hold_deceleration;     ///< demanded of the brake at standstill [m/s^2]
  double standstill_speed;      ///< below it the truck is held [m/s]
  double rollback_speed;        ///< rolling back faster than this on a slope is braked [m/s]
  double speed_gain;            ///< of the speed loop [1/s]
  double speed_integral_gain;   ///< [1/s^2]
  double speed_lead;            ///< the ramped speed may run ahead of the measured one [m/s]
  double override_wheel;        ///< wheel turn that takes over [rad]
  double override_brake;        ///< pedal that takes over [1]
  double wheel_ratio;           ///< articulation over wheel turn, when the operator steers [1]
  double full_brake_pressure;   ///< at service_deceleration [Pa]
  can::Profile can;             ///< of its bus, for whoever makes that
};

/// Throws config::ConfigError naming file, key, unit and range.
TruckControllerParameters loadTruckController(config::Node node);

/// The truck as its own sensors tell it, with their errors.
struct SensedTruck {
  double articulation = 0.0;                   ///< [rad]
  double articulation_rate = 0.0;              ///< [rad/s]
  double speed = 0.0;                          ///< of the front axle, forward positive [m/s]
  double rear_axle_speed = 0.0;                ///< [m/s]
  double yaw_rate = 0.0;                       ///< gyro of the front body [rad/s]
  double acceleration = 0.0;                   ///< longitudinal [m/s^2]
  double payload = 0.0;                        ///< [kg]
  std::optional<std::array<double, 7>> coils;  ///< amplitudes over full scale, where there are coils [1]
};

/// What the operator in the cab does.
struct OperatorInputs {
  can::OperatorKey key = can::OperatorKey::kAutonomous;
  double steering_wheel = 0.0;       ///< [rad], positive turns left
  double steering_wheel_rate = 0.0;  ///< [rad/s]
  double throttle = 0.0;             ///< [1] 0..1
  double brake = 0.0;                ///< [1] 0..1
};

/// The truck's own electronic controller behind the .dbc, as a real one would be built: it knows nothing
/// of the pilot but its frames.
///  - manual: the key is not at autonomous; wheel and pedals drive.
///  - ready: brakes, holds the articulation, waits for a frame with steering enabled, but only after it
///  saw
///    one without.
///  - obeying: follows ArticulationAngle and Speed. The speed is ramped with the commanded acceleration
///    (within drive_acceleration and service_deceleration) and followed by a PI loop; the stop bit
///    brakes with the service brake, steering as given.
///  - failed: while it obeyed, no valid TP_COMMAND came for command_timeout, or three of ten were wrong:
///    brakes to standstill and holds the articulation, tells a fault, and is ready again once it stands
///    and gets healthy frames that do not enable steering.
///  - overridden: the operator turned the wheel or pressed the brake: wheel and pedals drive until the
///  key
///    is turned away from autonomous.
/// Sends TRUCK_FEEDBACK, TRUCK_MOTION, TRUCK_STATUS and OPERATOR every frame_period, COILS_1 and COILS_2
/// where there are coils.
class TruckController {
 public:
  enum class State { kManual, kReady, kObeying, kFailed, kOverridden };

  TruckController(const TruckControllerParameters& parameters, can::Bus& bus);

  /// Reads the bus, decides, sends what is due. Returns what the actuators do until the next step. Call
  /// at least every frame_period.
  vehicle::PlantInput step(const SensedTruck& truck, Stamp now);

  void setOperator(const OperatorInputs& inputs) { operator_ = inputs; }

  /// Fault bits (can::TruckFault) that the truck shall tell beside its own. Any of them makes it fail.
  void setFaults(std::uint16_t faults) { injected_faults_ = faults; }

  /// As after the key was turned off and on: obeys nobody until it is engaged anew.
  void restart();

  State state() const { return state_; }
  std::uint16_t faults() const;

  /// TP_COMMAND_INFO's measurement stamp [ms, modulo 65536], as last received.
  std::optional<std::uint16_t> measurementStamp() const { return measurement_stamp_; }

  std::uint32_t framesAccepted() const { return frames_accepted_; }
  std::uint32_t framesRejected() const { return frames_rejected_; }

 private:
  void receive(Stamp now);
  void takeCommand(const can::Frame& frame, Stamp now);
  void decide(const SensedTruck& truck, Stamp now);
  bool commandFresh(Stamp now) const;
  bool operatorTakesOver() const;
  void enter(State state, const SensedTruck& truck);
  vehicle::PlantInput obey(const SensedTruck& truck, double dt);
  vehicle::PlantInput operatorDrives(const SensedTruck& truck);
  double followSpeed(double wanted, double limit, double speed, double dt);
  double brakeToStandstill(double speed) const;
  void sendFrames(const SensedTruck& truck, Stamp now);

  TruckControllerParameters parameters_;
  Stamp frame_period_;
  Stamp command_timeout_;
  can::Bus& bus_;
  OperatorInputs operator_;
  std::uint16_t injected_faults_ = 0;
  std::uint16_t own_faults_ = 0;
  State state_ = State::kManual;

  can::TruckCommandFrame command_;
  std::optional<Stamp> command_received_;
  can::StreamCheck command_check_;
  can::StreamCheck info_check_;
  std::optional<std::uint16_t> measurement_stamp_;
  bool saw_not_enabled_ = false;  ///< since ready was entered
  std::uint32_t frames_accepted_ = 0;
  std::uint32_t frames_rejected_ = 0;

  double held_articulation_ = 0.0;  ///< [rad]
  double wheel_at_takeover_ = 0.0;  ///< [rad]
  double ramped_speed_ = 0.0;       ///< [m/s]
  double speed_integral_ = 0.0;     ///< [m/s^2]
  double acceleration_ = 0.0;       ///< last demanded [m/s^2]
  std::optional<Stamp> last_step_;
  std::optional<Stamp> next_frames_;
  std::uint8_t counter_ = 0;
};

std::string toString(TruckController::State state);

}  // namespace tunnel_pilot::simulation
