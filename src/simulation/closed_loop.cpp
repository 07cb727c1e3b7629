#include "closed_loop.h"

#include <utility>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kRollUp = 2.5;           // long enough for all inputs to be healthy [s]
constexpr double kEngageRetry = 0.1;      // [s]
constexpr double kEngageTimeout = 10.0;   // [s]
constexpr double kFramesOnTheWay = 0.02;  // between the operator's edge and the truck obeying [s]
constexpr double kSpeedGain = 2.0;        // of the one who drives up [1/s] ...
constexpr double kSpeedIntegral = 0.5;    // ... who holds against rolling resistance [1/s^2]

}  // namespace

ClosedLoop::ClosedLoop(const Scenario& scenario, const Setup& setup, const PilotParameters& pilot,
                       world::World world, const EpisodePlan& plan)
    : truck_(setup.truck.geometry),
      truck_side_(can::withProfile(setup.truck_controller.can, hub_.connect())),
      pilot_side_(can::withProfile(pilot.bridge.can, hub_.connect())),
      simulator_(setup.simulator, setup.truck_controller, setup.truck,
                 makePlant(scenario.plant, setup.truck, plan.seed), scenario.plant.load,
                 std::move(world), plan.seed, *truck_side_),
      pilot_(pilot, setup.truck, *pilot_side_) {
  if (plan.can_log == nullptr) return;
  log_.emplace(*plan.can_log);
  log_side_ = hub_.connect();
  logEvent("start");
}

void ClosedLoop::step() {
  const Stamp sent = simulator_.now();  // the truck's frames, at the beginning of the step
  const Simulator::Events& events = simulator_.step();
  logFrames(sent);
  if (events.scan != nullptr) takeScan(*events.scan);
  if (simulator_.now() >= next_tick_) {
    pilot_.tick(simulator_.now());
    next_tick_ += fromSeconds(1.0 / Pilot::kTickRate);
  }
  logPilot();
  if (!events.truth || !driving_) return;
  record();
  takeTruth();
}

void ClosedLoop::driveUp(double speed) {
  const double error = speed - simulator_.state().speed;
  missed_way_ += error * simulator_.parameters().step;
  simulator_.lead(vehicle::PlantInput{0.0, kSpeedGain * error + kSpeedIntegral * missed_way_});
}

bool ClosedLoop::handOver(const geometry::Pose& start, double speed) {
  const bool rolling = speed > 0.0;
  simulator_.place(start.compose({-speed * kRollUp, 0.0, 0.0}), speed);
  const double first_try = rolling ? kRollUp - kFramesOnTheWay : 0.0;
  double next_try = first_try;
  bool accepted = false;
  while (simulator_.controller().state() != TruckController::State::kObeying) {
    const double now = toSeconds(simulator_.now());
    if (now > first_try + kEngageTimeout) return false;
    if (!accepted && now >= next_try) {
      accepted = pilot_.engage(simulator_.now()).accepted;
      next_try = now + kEngageRetry;
      if (accepted) logEvent("engage");
      logPilot();
    }
    if (rolling) driveUp(speed);
    step();
  }
  simulator_.lead({});
  driving_ = true;
  start_time_ = simulator_.now();
  start_contacts_ = simulator_.truth().contacts;
  return true;
}

void ClosedLoop::logEvent(const std::string& words) {
  if (log_) log_->event(words, simulator_.now());
}

// A scan serves whoever proposes; that it was good is the pilot's to find out.
void ClosedLoop::logMeasurement(Stamp stamp) {
  const double age = 1e3 * toSeconds(simulator_.now() - stamp);  // [ms]
  for (const char* source : {"lidar_driver", "preview_driver"}) {
    logEvent(std::string("measurement ") + source + " " + std::to_string(age));
  }
}

void ClosedLoop::logPilot() {
  if (!log_) return;
  const bool stop = pilot_.decision().command.stop;
  if (stop && !stop_commanded_) logEvent("command_stop");
  stop_commanded_ = stop;
  logFrames(simulator_.now());
}

void ClosedLoop::logFrames(Stamp when) {
  if (!log_) return;
  while (const std::optional<can::Frame> frame = log_side_->receive()) log_->frame(*frame, when);
}

void ClosedLoop::record() {
  const Truth& truth = simulator_.truth();
  TrackSample sample = sampleOf(truth.state, truck_);
  sample.time = toSeconds(truth.stamp - start_time_);
  sample.articulation_command = simulator_.articulationCommand();
  sample.station = truth.station;
  sample.lateral_offset = truth.lateral_offset;
  sample.heading_error = truth.heading_error;
  sample.curvature = truth.curvature;
  sample.clearance = truth.clearance;
  track_.push_back(sample);
}

std::string ClosedLoop::whyOver(double time_limit) const {
  if (simulator_.truth().contacts > start_contacts_) return "contact";
  if (time() > time_limit) return "time over";
  const bridge::BridgeStatus& status = pilot_.bridge().status();
  if (status.state == bridge::SafetyState::kStopped) {
    return "stopped: " + supervision::toString(status.reason);
  }
  return "";
}

}  // namespace tunnel_pilot::simulation
