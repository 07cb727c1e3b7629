#pragma once

#include <cstdint>
#include <memory>

#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/vehicle/plant.h"

namespace tunnel_pilot::simulation {

/// The parts of a track sample that the plant knows.
TrackSample sampleOf(const vehicle::PlantState& state, const vehicle::TruckGeometry& truck);

/// What the perception said of a scan beside the truth at the scan's stamp.
PerceptionSample comparePerception(const perception::TunnelState& measured, const Truth& truth,
                                   double width);

// One episode of each kind of experiment; `reversed` where there is a direction.
EpisodeResult runDrive(const DriveExperiment& drive, const Scenario& scenario, const Setup& setup,
                       const EpisodePlan& plan, DriveObserver* observer);
EpisodeResult runSteadyTurn(const SteadyTurnExperiment& turn, const Scenario& scenario,
                            const Setup& setup, std::uint64_t seed);
EpisodeResult runLaneChange(const LaneChangeExperiment& change, const Scenario& scenario,
                            const Setup& setup, const EpisodePlan& plan, DriveObserver* observer);
EpisodeResult runPerception(const PerceptionExperiment& experiment, const Setup& setup,
                            std::uint64_t seed, bool reversed);

}  // namespace tunnel_pilot::simulation
