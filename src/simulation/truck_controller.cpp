#include "tunnel_pilot/simulation/truck_controller.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::simulation {

TruckControllerParameters loadTruckController(config::Node node) {
  TruckControllerParameters p{};
  p.frame_period = node.number("frame_period", "s", 0.005, 0.05);
  p.command_timeout = node.number("command_timeout", "s", 0.04, 0.5);
  p.drive_acceleration = node.number("drive_acceleration", "m/s^2", 0.1, 3.0);
  p.service_deceleration = node.number("service_deceleration", "m/s^2", 0.5, 5.0);
  p.stop_deceleration = node.number("stop_deceleration", "m/s^2", 0.5, p.service_deceleration);
  p.hold_deceleration = node.number("hold_deceleration", "m/s^2", 0.5, p.service_deceleration);
  p.standstill_speed = node.number("standstill_speed", "m/s", 0.01, 0.5);
  p.rollback_speed = node.number("rollback_speed", "m/s", 0.1, 1.0);
  p.speed_gain = node.number("speed_gain", "1/s", 0.1, 10.0);
  p.speed_integral_gain = node.number("speed_integral_gain", "1/s^2", 0.0, 5.0);
  p.speed_lead = node.number("speed_lead", "m/s", 0.1, 2.0);
  p.override_wheel = node.number("override_wheel", "rad", 0.01, 1.0);
  p.override_brake = node.number("override_brake", "1", 0.01, 1.0);
  p.wheel_ratio = node.number("wheel_ratio", "1", 0.01, 1.0);
  p.full_brake_pressure = node.number("full_brake_pressure", "Pa", 1e5, 3e7);
  p.can = can::loadProfile(node, can::Side::kTruck);
  node.finish();
  return p;
}

std::string toString(TruckController::State state) {
  switch (state) {
    case TruckController::State::kManual:
      return "manual";
    case TruckController::State::kReady:
      return "ready";
    case TruckController::State::kObeying:
      return "obeying";
    case TruckController::State::kFailed:
      return "failed";
    case TruckController::State::kOverridden:
      return "overridden";
  }
  return "unknown";
}

TruckController::TruckController(const TruckControllerParameters& parameters, can::Bus& bus)
    : parameters_(parameters),
      frame_period_(fromSeconds(parameters.frame_period)),
      command_timeout_(fromSeconds(parameters.command_timeout)),
      bus_(bus) {}

std::uint16_t TruckController::faults() const {
  return static_cast<std::uint16_t>(own_faults_ | injected_faults_);
}

vehicle::PlantInput TruckController::step(const SensedTruck& truck, Stamp now) {
  const double dt = last_step_ ? toSeconds(now - *last_step_) : 0.0;
  last_step_ = now;
  receive(now);
  decide(truck, now);
  vehicle::PlantInput out;
  switch (state_) {
    case State::kManual:
    case State::kOverridden:
      out = operatorDrives(truck);
      break;
    case State::kObeying:
      out = obey(truck, dt);
      break;
    case State::kReady:
    case State::kFailed:
      out = {held_articulation_, brakeToStandstill(truck.speed)};
      break;
  }
  acceleration_ = out.acceleration;
  sendFrames(truck, now);
  return out;
}

// -------- what it hears

void TruckController::receive(Stamp now) {
  bus_.tick(now);
  while (const std::optional<can::Frame> frame = bus_.receive()) {
    if (frame->extended) continue;
    if (frame->id == can::kTpCommandId) takeCommand(*frame, now);
    if (frame->id == can::kTpCommandInfoId) {
      const auto info = can::decode<can::CommandInfoFrame>(*frame);
      if (info && info_check_.accept(info->counter)) measurement_stamp_ = info->measurement_stamp_ms;
    }
  }
}

void TruckController::takeCommand(const can::Frame& frame, Stamp now) {
  const auto command = can::decode<can::TruckCommandFrame>(frame);
  if (!command) command_check_.reject();
  if (!command || !command_check_.accept(command->counter)) {
    ++frames_rejected_;
    return;
  }
  ++frames_accepted_;
  command_ = *command;
  command_received_ = now;
  if (!command_.steering_enable) saw_not_enabled_ = true;
}

bool TruckController::commandFresh(Stamp now) const {
  return command_received_ && now - *command_received_ <= command_timeout_;
}

// -------- what it decides

bool TruckController::operatorTakesOver() const {
  return std::abs(operator_.steering_wheel - wheel_at_takeover_) > parameters_.override_wheel ||
         operator_.brake > parameters_.override_brake;
}

void TruckController::enter(State state, const SensedTruck& truck) {
  if (state == State::kManual || state == State::kReady) wheel_at_takeover_ = operator_.steering_wheel;
  if (state == State::kReady) saw_not_enabled_ = false;
  held_articulation_ = truck.articulation;
  ramped_speed_ = truck.speed;
  speed_integral_ = 0.0;
  state_ = state;
}

void TruckController::restart() {
  own_faults_ = 0;
  state_ = State::kManual;  // and ready at the next step, if the key is at autonomous
}

void TruckController::decide(const SensedTruck& truck, Stamp now) {
  const bool key = operator_.key == can::OperatorKey::kAutonomous;
  if (!key) {
    own_faults_ = 0;
    if (state_ != State::kManual) enter(State::kManual, truck);
    return;
  }
  if (state_ == State::kManual) enter(State::kReady, truck);
  if (state_ != State::kOverridden && operatorTakesOver()) enter(State::kOverridden, truck);
  const bool healthy = commandFresh(now) && !command_check_.faulty() && injected_faults_ == 0;
  switch (state_) {
    case State::kReady:
      if (healthy && saw_not_enabled_ && command_.steering_enable) enter(State::kObeying, truck);
      break;
    case State::kObeying:
      if (!commandFresh(now)) own_faults_ |= can::kFaultCommandTimeout;
      if (command_check_.faulty()) own_faults_ |= can::kFaultCommandCorrupt;
      if (!healthy) {
        enter(State::kFailed, truck);
        saw_not_enabled_ = false;
      } else if (!command_.steering_enable) {
        enter(State::kReady, truck);
      }
      break;
    case State::kFailed:
      if (healthy && saw_not_enabled_ && std::abs(truck.speed) < parameters_.standstill_speed) {
        own_faults_ = 0;
        enter(State::kReady, truck);
      }
      break;
    default:
      break;
  }
}

// -------- what it does

vehicle::PlantInput TruckController::obey(const SensedTruck& truck, double dt) {
  if (command_.stop) {
    ramped_speed_ = truck.speed;
    speed_integral_ = 0.0;
    return {command_.articulation_angle, brakeToStandstill(truck.speed)};
  }
  const double wanted = std::max(command_.speed, 0.0);  // forward driving only
  return {command_.articulation_angle, followSpeed(wanted, command_.acceleration, truck.speed, dt)};
}

vehicle::PlantInput TruckController::operatorDrives(const SensedTruck& truck) {
  const double turned = operator_.steering_wheel - wheel_at_takeover_;
  const double drive = operator_.throttle * parameters_.drive_acceleration;
  const double brake = operator_.brake * parameters_.service_deceleration;
  const bool idle = operator_.throttle <= 0.0 && std::abs(truck.speed) < parameters_.standstill_speed;
  const double acceleration = idle ? -parameters_.hold_deceleration : drive - brake;
  return {held_articulation_ + parameters_.wheel_ratio * turned, acceleration};
}

double TruckController::brakeToStandstill(double speed) const {
  return std::abs(speed) < parameters_.standstill_speed ? -parameters_.hold_deceleration
                                                        : -parameters_.stop_deceleration;
}

/// The wanted speed is ramped within `limit` [m/s^2]; a = ramp' + k_p (ramp - v) + k_i int(ramp - v) dt,
/// limited to what drive and brake can; the integral waits while the limit holds.
double TruckController::followSpeed(double wanted, double limit, double speed, double dt) {
  const double up = std::min(limit, parameters_.drive_acceleration) * dt;
  const double down = std::min(limit, parameters_.service_deceleration) * dt;
  const double before = ramped_speed_;
  ramped_speed_ += std::clamp(wanted - ramped_speed_, -down, up);
  const double slope = dt > 0.0 ? (ramped_speed_ - before) / dt : 0.0;
  ramped_speed_ =
      std::clamp(ramped_speed_, speed - parameters_.speed_lead, speed + parameters_.speed_lead);
  const bool held = wanted <= 0.0 && speed < parameters_.standstill_speed;
  if (held || speed < -parameters_.rollback_speed) {
    ramped_speed_ = 0.0;
    speed_integral_ = 0.0;
    return brakeToStandstill(speed);
  }
  const double error = ramped_speed_ - speed;
  const double asked = slope + parameters_.speed_gain * error + speed_integral_;
  const double given =
      std::clamp(asked, -parameters_.service_deceleration, parameters_.drive_acceleration);
  const bool winding_up = (asked > given && error > 0.0) || (asked < given && error < 0.0);
  if (!winding_up) speed_integral_ += parameters_.speed_integral_gain * error * dt;
  return given;
}

// -------- what it says

void TruckController::sendFrames(const SensedTruck& truck, Stamp now) {
  if (next_frames_ && now < *next_frames_) return;
  const bool in_step = next_frames_ && now < *next_frames_ + frame_period_;
  next_frames_ = (in_step ? *next_frames_ : now) + frame_period_;
  counter_ = can::nextCounter(counter_);
  const auto send = [this](const std::optional<can::Frame>& frame) {
    if (frame) bus_.send(*frame);
  };
  const double braking = std::clamp(-acceleration_ / parameters_.service_deceleration, 0.0, 1.0);
  const bool key = operator_.key == can::OperatorKey::kAutonomous;
  send(can::encode(can::TruckMotionFrame{counter_, truck.speed, truck.rear_axle_speed,
                                         truck.acceleration, truck.yaw_rate}));
  send(can::encode(can::TruckStatusFrame{counter_, static_cast<std::uint8_t>(operator_.key), faults(),
                                         truck.payload, braking * parameters_.full_brake_pressure}));
  send(can::encode(can::TruckFeedbackFrame{counter_, state_ == State::kObeying, key,
                                           state_ == State::kOverridden, faults() != 0,
                                           truck.articulation, truck.articulation_rate, truck.speed}));
  send(can::encode(can::OperatorFrame{counter_, operator_.steering_wheel, operator_.steering_wheel_rate,
                                      operator_.throttle, operator_.brake}));
  if (truck.coils) {
    const auto& c = *truck.coils;
    send(can::encode(can::Coils1Frame{counter_, {c[0], c[1], c[2], c[3]}}));
    send(can::encode(can::Coils2Frame{counter_, {c[4], c[5], c[6]}}));
  }
}

}  // namespace tunnel_pilot::simulation
