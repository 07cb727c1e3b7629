#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/learning/teacher.h"
#include "tunnel_pilot/simulation/episode.h"

namespace tunnel_pilot::learning {

/// How far the sampled trucks stand from where they should be.
struct SceneSpread {
  double offset = 0.7;                      ///< [m] largest
  double heading = 0.25;                    ///< [rad] largest
  double articulation = 0.2;                ///< [rad] largest
  double lean = 0.04;                       ///< of the demand on the way on from there [rad] largest
  double speed_min = 2.0, speed_max = 3.2;  ///< [m/s]
  double gain_min = 0.7, gain_max = 1.25;   ///< yaw gain g [1]
  double disturbance = 0.006;               ///< d, largest [1/m]
  double slower = 0.25;                     ///< than its steering's max_rate, at most [1]
  double bias_error = 0.5;                  ///< share of the articulation sensor's bias not learned
  double ahead_error = 0.005;               ///< of the articulation foretold, standard deviation [rad]
};

/// Scans from places where no drive would come by itself, beside the demand that leads back: Pomerleau's
/// shifts and turns, with real scans instead of distorted ones, since the world is simulated.
DataSet sampleScenes(const std::string& world_file, std::uint64_t seed, std::size_t count,
                     const simulation::Setup& setup, const TeacherParameters& teacher,
                     const SceneSpread& spread);

}  // namespace tunnel_pilot::learning
