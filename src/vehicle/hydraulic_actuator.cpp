#include "tunnel_pilot/vehicle/hydraulic_actuator.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::vehicle {
namespace {

constexpr std::int64_t kSlot = 1000000;  // one slot of the delay line [ns]

}  // namespace

HydraulicActuator::HydraulicActuator(const HydraulicSteering& parameters, double max_articulation)
    : parameters_(parameters),
      max_articulation_(max_articulation),
      dead_time_(std::llround(parameters.dead_time * 1e9)) {
  demands_.resize(static_cast<std::size_t>(dead_time_ / kSlot) + 2);
}

void HydraulicActuator::reset(double angle) {
  std::fill(demands_.begin(), demands_.end(), angle);
  now_ = dead_time_;  // so that what is read first is what stands in the line
  valve_ = angle_ = angle;
  rate_ = 0.0;
}

// A demand is written into the slot of its millisecond; steps of at most a millisecond leave no gap.
double HydraulicActuator::delayed(double demand, double dt) {
  const auto slots = static_cast<std::int64_t>(demands_.size());
  demands_[static_cast<std::size_t>(now_ / kSlot % slots)] = demand;
  const double old = demands_[static_cast<std::size_t>((now_ - dead_time_) / kSlot % slots)];
  now_ += std::llround(dt * 1e9);
  return old;
}

void HydraulicActuator::step(double demand, double speed, double dt) {
  const double target = delayed(std::clamp(demand, -max_articulation_, max_articulation_), dt);
  const double engine = std::min(1.0, std::abs(speed) / parameters_.working_speed);
  const double flow = parameters_.idle_rate + (parameters_.max_rate - parameters_.idle_rate) * engine;
  const double play = 0.5 * parameters_.dead_band;
  const double wanted = std::clamp(valve_, target - play, target + play);
  valve_ += std::clamp(wanted - valve_, -flow * dt, flow * dt);
  rate_ = (valve_ - angle_) / (parameters_.lag + dt);
  angle_ += rate_ * dt;
}

}  // namespace tunnel_pilot::vehicle
