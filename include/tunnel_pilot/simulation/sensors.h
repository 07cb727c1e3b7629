#pragma once

#include <cstdint>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::simulation {

/// Errors of a sensor whose reading is value * scale + bias + noise; a unit's scale and bias are drawn
/// once per seed, uniformly.
struct SensorParameters {
  double sigma;      ///< noise of one reading, in the reading's unit
  double bias_max;   ///< a unit's bias is drawn from +- this, in the reading's unit
  double scale_max;  ///< a unit's scale is drawn from 1 +- this [1]
  double drift;      ///< random walk of the bias, in the reading's unit per square root of a second
};

/// Loads the four keys; `unit` is that of the reading.
SensorParameters loadSensor(config::Node node, const std::string& unit);

/// One scalar sensor: the articulation sensor [rad], the wheel speed sensor [m/s], the gyro [rad/s].
class Sensor {
 public:
  Sensor(const SensorParameters& parameters, std::uint64_t seed, Stream stream);

  /// Reading of `value`, `dt` [s] after the last one.
  double measure(double value, double dt);

  double bias() const { return bias_; }
  double scale() const { return scale_; }

 private:
  SensorParameters parameters_;
  Random random_;
  double bias_;
  double scale_;
};

}  // namespace tunnel_pilot::simulation
