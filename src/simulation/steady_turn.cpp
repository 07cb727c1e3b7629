#include "experiments.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr double kSpeedGain = 2.0;     // [1/s]
constexpr double kIntegralGain = 0.5;  // holds against rolling resistance [1/s^2]
constexpr double kRecordRate = 50.0;   // [Hz]

}  // namespace

EpisodeResult runSteadyTurn(const SteadyTurnExperiment& turn, const Scenario& scenario,
                            const Setup& setup, std::uint64_t seed) {
  const std::unique_ptr<vehicle::Plant> plant = makePlant(scenario.plant, setup.truck, seed);
  const double step = setup.simulator.step;
  const auto steps = static_cast<std::int64_t>(turn.duration / step);
  const auto record_every = static_cast<std::int64_t>(1.0 / (kRecordRate * step));
  EpisodeResult result;
  double missed = 0.0;  // speed error integrated [m]
  plant->reset({}, 0.0, turn.speed);
  for (std::int64_t i = 0; i <= steps; ++i) {
    if (i % record_every == 0) {
      TrackSample sample = sampleOf(plant->state(), setup.truck.geometry);
      sample.time = static_cast<double>(i) * step;
      sample.articulation_command = turn.articulation;
      result.track.push_back(sample);
    }
    const double error = turn.speed - plant->state().speed;
    missed += error * step;
    plant->step({turn.articulation, kSpeedGain * error + kIntegralGain * missed}, {}, step);
  }
  result.metrics = steadyTurnMetrics(result.track, turn.settled, turn.angle);
  result.ending = "time over";
  return result;
}

}  // namespace tunnel_pilot::simulation
