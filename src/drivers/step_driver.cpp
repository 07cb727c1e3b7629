#include "tunnel_pilot/drivers/step_driver.h"

#include <algorithm>
#include <array>

namespace tunnel_pilot::drivers {
namespace {

// Of the amplitude; every side comes as often, with pauses of different length.
constexpr std::array<double, 8> kSteps = {1.0, -1.0, 0.3, -0.3, 1.0, -0.3, 0.3, -1.0};
constexpr std::array<double, 3> kPauses = {0.8, 1.2, 1.0};  // of the mean

}  // namespace

StepDriverParameters loadStepDriver(config::Node node) {
  StepDriverParameters p{};
  p.amplitude = node.number("amplitude", "rad", 0.01, 0.2);
  p.hold = node.number("hold", "s", 0.5, 10.0);
  p.speed = node.number("speed", "m/s", 0.3, 3.0);
  node.finish();
  return p;
}

StepDriver::StepDriver(const StepDriverParameters& parameters) : parameters_(parameters) {}

Proposal StepDriver::propose(const Proposal& base, Stamp now) {
  if (!started_) next_ = now + fromSeconds(parameters_.hold);
  started_ = true;
  if (now >= next_) {
    ++step_;
    next_ = now + fromSeconds(parameters_.hold * kPauses[step_ % kPauses.size()]);
  }
  Proposal proposal = base;
  proposal.articulation_angle += parameters_.amplitude * kSteps[step_ % kSteps.size()];
  proposal.speed = std::min(proposal.speed, parameters_.speed);
  return proposal;
}

}  // namespace tunnel_pilot::drivers
