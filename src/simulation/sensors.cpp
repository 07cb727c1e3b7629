#include "tunnel_pilot/simulation/sensors.h"

#include <cmath>

namespace tunnel_pilot::simulation {

SensorParameters loadSensor(config::Node node, const std::string& unit) {
  SensorParameters sensor;
  sensor.sigma = node.number("sigma", unit, 0.0, 1.0);
  sensor.bias_max = node.number("bias_max", unit, 0.0, 1.0);
  sensor.scale_max = node.number("scale_max", "1", 0.0, 0.5);
  sensor.drift = node.number("drift", unit + "/sqrt(s)", 0.0, 1.0);
  node.finish();
  return sensor;
}

Sensor::Sensor(const SensorParameters& parameters, std::uint64_t seed, Stream stream)
    : parameters_(parameters), random_(seed, stream) {
  bias_ = random_.uniform(-parameters.bias_max, parameters.bias_max);
  scale_ = 1.0 + random_.uniform(-parameters.scale_max, parameters.scale_max);
}

double Sensor::measure(double value, double dt) {
  if (parameters_.drift > 0.0) bias_ += parameters_.drift * std::sqrt(dt) * random_.normal();
  return value * scale_ + bias_ + parameters_.sigma * random_.normal();
}

}  // namespace tunnel_pilot::simulation
