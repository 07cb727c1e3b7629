#include "tunnel_pilot/supervision/arbiter_tuning.h"

namespace tunnel_pilot::supervision {

const std::vector<ArbiterTunable>& arbiterTunables() {
  using Parameters = ArbiterParameters;
  constexpr bool kHigherLoosens = true;
  constexpr bool kHigherTightens = false;
  // The ranges are the loaders': a test says when one differs.
  static const std::vector<ArbiterTunable> tunables = {
      {{"governor.max_speed", "m/s", 0.1, 15.0, kHigherLoosens},
       [](Parameters& p) -> double& { return p.governor.max_speed; }},
      {{"governor.max_lateral_acceleration", "m/s^2", 0.1, 5.0, kHigherLoosens},
       [](Parameters& p) -> double& { return p.governor.max_lateral_acceleration; }},
      {{"governor.max_articulation_rate", "rad/s", 0.01, 2.0, kHigherLoosens},
       [](Parameters& p) -> double& { return p.governor.max_articulation_rate; }},
      {{"governor.bend_deceleration", "m/s^2", 0.1, 5.0, kHigherLoosens},
       [](Parameters& p) -> double& { return p.governor.bend_deceleration; }},
      {{"governor.sight_reserve", "m", 0.0, 20.0, kHigherTightens},
       [](Parameters& p) -> double& { return p.governor.sight_reserve; }},
      {{"envelope.margin", "m", 0.0, 2.0, kHigherTightens},
       [](Parameters& p) -> double& { return p.envelope.margin; }},
      {{"envelope.reserve", "m", 0.0, 10.0, kHigherTightens},
       [](Parameters& p) -> double& { return p.envelope.reserve; }},
      {{"degraded.speed", "m/s", 0.1, 5.0, kHigherLoosens},
       [](Parameters& p) -> double& { return p.degraded_speed; }},
      {{"disagreement.angle", "rad", 0.01, 1.0, kHigherLoosens},
       [](Parameters& p) -> double& { return p.disagreement_angle; }},
  };
  return tunables;
}

config::Tuning tuningOf(const Arbiter& arbiter) {
  ArbiterParameters parameters = arbiter.parameters();
  std::vector<config::TunableNumber> numbers;
  std::vector<double> values;
  for (const ArbiterTunable& tunable : arbiterTunables()) {
    numbers.push_back(tunable.number);
    values.push_back(tunable.of(parameters));
  }
  return {numbers, values};
}

void Arbiter::tune(const std::vector<double>& values) {
  for (std::size_t i = 0; i < arbiterTunables().size(); ++i) {
    arbiterTunables()[i].of(parameters_) = values.at(i);
  }
  governor_ = SpeedGovernor(parameters_.governor);
  envelope_.setMargin(parameters_.envelope.margin);
}

bool Arbiter::mayLoosen(Stamp now) const {
  if (!parameters_.needs_truck_state || !seen_.truck_state_received) return false;
  const double silence = toSeconds(now - *seen_.truck_state_received);
  return silence <= parameters_.truck_state_stop_age && !truck_state_.engaged && !truck_state_.stopping;
}

}  // namespace tunnel_pilot::supervision
