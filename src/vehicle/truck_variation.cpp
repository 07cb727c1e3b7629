#include "tunnel_pilot/vehicle/truck_variation.h"

#include <initializer_list>
#include <random>
#include <stdexcept>

namespace tunnel_pilot::vehicle {

TruckParameters varied(const TruckParameters& truck, std::uint64_t seed, double fraction) {
  if (!(fraction >= 0.0 && fraction < 0.5)) {
    throw std::invalid_argument("a truck's variation must be a fraction in [0, 0.5)");
  }
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> factor(1.0 - fraction, 1.0 + fraction);
  const auto vary = [&](std::initializer_list<double*> values) {
    for (double* value : values) *value *= factor(engine);
  };

  TruckParameters t = truck;
  for (TruckMasses* m : {&t.empty, &t.loaded}) {
    vary({&m->front, &m->rear, &m->front_inertia, &m->rear_inertia, &m->cg_height});
  }
  vary({&t.tyre.cornering_coefficient, &t.tyre.relaxation_length, &t.tyre.friction, &t.tyre.yaw_gain});
  vary({&t.steering.dead_time, &t.steering.dead_band, &t.steering.lag, &t.steering.compliance_frequency,
        &t.steering.compliance_damping});
  const double flow = factor(engine);
  t.steering.max_rate *= flow;
  t.steering.idle_rate *= flow;
  vary({&t.drive.drive_acceleration, &t.drive.drive_lag, &t.drive.brake_deceleration, &t.drive.brake_lag,
        &t.drive.rolling_resistance});
  for (AxleSuspension* s : {&t.front_suspension, &t.rear_suspension}) {
    vary({&s->stiffness, &s->damping, &s->tyre_stiffness});
  }
  vary({&t.road_roughness});
  return t;
}

}  // namespace tunnel_pilot::vehicle
