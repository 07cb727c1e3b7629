#include "tunnel_pilot/vehicle/drive_train.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::vehicle {
namespace {

// The governor's gain times the drive's lag: critically damped, so that the top speed is not overshot
// [1].
constexpr double kGovernorGain = 0.25;

}  // namespace

DriveTrain::DriveTrain(const TruckParameters& parameters, Load load) : parameters_(parameters.drive) {
  const double loaded = parameters.loaded.front + parameters.loaded.rear;
  const double rolling = parameters_.rolling_resistance * kGravity;
  mass_ = parameters.masses(load).front + parameters.masses(load).rear;
  drive_limit_ = loaded * (parameters_.drive_acceleration + rolling);
  brake_limit_ = loaded * std::max(0.0, parameters_.brake_deceleration - rolling);
}

void DriveTrain::reset(double brake_temperature) {
  drive_force_ = brake_force_ = 0.0;
  temperature_ = brake_temperature;
}

void DriveTrain::step(double acceleration, double speed, double dt) {
  const DriveAndBrakes& p = parameters_;
  const double asked = mass_ * acceleration;
  const double governor =
      mass_ * (kGovernorGain / p.drive_lag * (p.max_speed - speed) + p.rolling_resistance * kGravity);
  const double fade = p.brake_fade * std::clamp(temperature_ / p.brake_fade_temperature, 0.0, 1.0);
  const double drive = std::max(0.0, std::min({asked, drive_limit_, governor}));
  const double brake = std::clamp(-asked, 0.0, brake_limit_ * (1.0 - fade));
  drive_force_ += (drive - drive_force_) * dt / (p.drive_lag + dt);
  brake_force_ += (brake - brake_force_) * dt / (p.brake_lag + dt);
  temperature_ += dt * (brake_force_ * std::abs(speed) / p.brake_heat_capacity -
                        temperature_ / p.brake_cooling_time);
}

}  // namespace tunnel_pilot::vehicle
