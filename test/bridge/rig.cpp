#include "rig.h"

#include <cmath>

namespace tunnel_pilot::bridge {
namespace {

constexpr double kDeg = 3.14159265358979323846 / 180.0;

config::Node file(const std::string& name) {
  return config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name);
}

}  // namespace

// -------- Judge

void Judge::complain(const std::string& what, Stamp now) {
  complaints.push_back(std::to_string(toSeconds(now)) + " s: " + what);
}

void Judge::stopAsked(Stamp now) {
  if (!stop_asked_) stop_asked_ = now;
}

void Judge::frame(const can::Frame& frame, const BridgeStatus& status, Stamp last_feedback, Stamp now) {
  if (frame.id == can::kTpCommandId) command(frame, status, last_feedback, now);
  if (frame.id == can::kTpCommandInfoId) {
    const auto info = can::decode<can::CommandInfoFrame>(frame);
    if (!info) return complain("info frame does not decode", now);
    if (last_info && info->sequence < last_info->sequence) complain("sequence decreases", now);
    last_info = info;
  }
}

void Judge::command(const can::Frame& frame, const BridgeStatus& status, Stamp last_feedback,
                    Stamp now) {
  const auto command = can::decode<can::TruckCommandFrame>(frame);
  if (!command) return complain("command frame does not decode", now);
  if (last) {
    const double dt = toSeconds(now - times.back());
    const double turned = std::abs(command->articulation_angle - last->articulation_angle) / kDeg;
    if (command->counter != (last->counter + 1) % 15) complain("counter step", now);
    if (command->steering_enable && last->steering_enable && turned > 15.0 * dt + 0.011) {
      complain("angle rate " + std::to_string(turned / dt) + " deg/s", now);
    }
  }
  if (times.size() >= 16 && now - times[times.size() - 16] <= ms(250)) complain("too many frames", now);
  const bool may_steer = status.state == SafetyState::kActive ||
                         status.state == SafetyState::kDegraded ||
                         status.state == SafetyState::kStopping;
  if (command->steering_enable && !may_steer) complain("steers in " + toString(status.state), now);
  if (command->steering_enable && now - last_feedback > ms(60)) complain("steers on old feedback", now);
  if (status.state == SafetyState::kDegraded && command->speed > 1.5 + 1e-9)
    complain("fast in DEGRADED", now);
  if (!command->stop && stop_asked_ && now - *stop_asked_ > ms(20)) complain("no stop bit", now);
  last = command;
  commands.push_back(*command);
  times.push_back(now);
}

// -------- Rig

BridgeParameters Rig::bridgeParameters() { return loadBridge(file("can_bridge.yaml")); }
vehicle::TruckParameters Rig::truckParameters() { return vehicle::loadTruck(file("truck.yaml")); }

Rig::Rig(double tick) : Rig(tick, nullptr) {}

Rig::Rig(double tick, const MakeBus& make_bus) : Rig(tick, make_bus, can::ProfileKind::kPlain) {}

Rig::Rig(double tick, can::ProfileKind kind) : Rig(tick, nullptr, kind) {}

Rig::Rig(double tick, const MakeBus& make_bus, can::ProfileKind kind)
    : tick_period(tick),
      profile(kind),
      plant(truckParameters()),
      next_tick_(now),
      next_command_(now + ms(3)) {
  const auto controller_parameters = simulation::loadTruckController(file("truck_controller.yaml"));
  bridge_end = can::withProfile({kind, bridgeParameters().can.j1939}, bridge_side.connect());
  wire_to_bridge = bridge_side.connect();
  truck_bus = can::withProfile({kind, controller_parameters.can.j1939}, truck_side.connect());
  wire_to_truck = truck_side.connect();
  if (make_bus) bridge_bus = make_bus(*bridge_end);
  bridge = std::make_unique<CanBridge>(bridgeParameters(), truckParameters().geometry,
                                       bridge_bus ? *bridge_bus : *bridge_end);
  controller = std::make_unique<simulation::TruckController>(controller_parameters, *truck_bus);
  plant.reset(geometry::Pose(), 0.0, 0.0);
  command.speed = 3.0;
  command.acceleration = 0.8;
  command.mode = supervision::Mode::kAutonomous;
  command.source = supervision::Source::kPreviewDriver;
}

void Rig::run(double seconds, const std::function<bool()>& until) {
  const Stamp end = now + fromSeconds(seconds);
  while (now < end && !until()) step();
}

void Rig::step() {
  now += ms(1);
  if (truck_alive) moveTruck();
  pump();
  if (arbiter_alive && now >= next_command_) {
    next_command_ = now + ms(20);
    sendCommand();
    pump();
  }
  if (now >= next_tick_) {
    next_tick_ = now + fromSeconds(tick_period);
    bridge->tick(clock());
    pump();
  }
}

void Rig::moveTruck() {
  const vehicle::PlantState& state = plant.state();
  simulation::SensedTruck sensed;
  sensed.articulation = state.articulation;
  sensed.articulation_rate = state.articulation_rate;
  sensed.speed = sensed.rear_axle_speed = state.speed;
  sensed.yaw_rate = state.yaw_rate + gyro_bias;
  sensed.acceleration = state.acceleration;
  controller->setOperator(cab);
  vehicle::PlantInput input = controller->step(sensed, now);
  if (valve_stuck) input.steering = state.articulation;
  plant.step(input, vehicle::PlantSurroundings(), 1e-3);
}

can::Frame Rig::plain(can::Frame frame) const {
  if (profile == can::ProfileKind::kPlain) return frame;
  for (const can::J1939Group& group : can::j1939Groups()) {
    if (group.pgn != can::fromIdentifier(frame.id).pgn) continue;
    frame.id = group.id;
    frame.extended = false;
  }
  return frame;
}

void Rig::pump() {
  while (const auto frame = wire_to_bridge->receive()) {
    judge.frame(plain(*frame), bridge->status(), last_feedback, now);
    log.push_back(*frame);
    if (const auto passed = to_truck(*frame)) wire_to_truck->send(*passed);
  }
  while (const auto frame = wire_to_truck->receive()) {
    log.push_back(*frame);
    const auto passed = to_bridge(*frame);
    if (!passed) continue;
    if (can::decode<can::TruckFeedbackFrame>(plain(*passed))) last_feedback = now;
    wire_to_bridge->send(*passed);
  }
}

void Rig::sendCommand() {
  supervision::Command sent = command;
  sent.sequence = command.sequence + sequence_++;
  sent.stamp = measurement.value_or(clock() - measurement_age);
  bridge->setCommand(sent, clock());
  last_command = now;
}

void Rig::drive(double speed) {
  command.speed = speed;
  run(1.5);
  bridge->engage(now);
  run(20.0, [&] { return state() == SafetyState::kActive && plant.state().speed > 0.97 * speed; });
}

void Rig::jump(Stamp by) {
  jumped_ += by;
  bridge->clockJumped(clock());
  pump();
}

void Rig::runToSet() {
  const std::size_t before = judge.commands.size();
  run(0.05, [&] { return judge.commands.size() > before; });
}

void Rig::runToTick() {
  const Stamp before = bridge->status().stamp;
  run(0.05, [&] { return bridge->status().stamp != before; });
}

double Rig::timeToStop(double seconds) {
  const Stamp start = now;
  run(seconds, [&] { return state() == SafetyState::kStopping; });
  return state() == SafetyState::kStopping ? toSeconds(now - start) : 1e9;
}

}  // namespace tunnel_pilot::bridge
