#include "tunnel_pilot/vehicle/axle_tyre.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::vehicle {
namespace {

constexpr double kTractionShare = 0.95;     // of mu F_z that drive and brakes may use [1]
constexpr double kAlongDampingRatio = 0.7;  // of an axle's mass on the wound-up spring [1]
constexpr double kAcrossDampingRatio = 0.5;
constexpr double kSlow = 0.5;  // damping fades out up to here [m/s]

}  // namespace

AxleTyre::AxleTyre(const TyreParameters& parameters, double static_load) : parameters_(parameters) {
  const double mass = static_load / kGravity;
  const double lateral = parameters.cornering_coefficient * static_load / parameters.relaxation_length;
  along_damping_ = 2.0 * kAlongDampingRatio * std::sqrt(parameters.longitudinal_stiffness * mass);
  across_damping_ = 2.0 * kAcrossDampingRatio * std::sqrt(lateral * mass);
}

void AxleTyre::reset() { along_deflection_ = across_deflection_ = across_capacity_ = 0.0; }

AxleTyre::Force AxleTyre::step(double along_speed, double across_speed, double load,
                               double friction_scale, double resistance, double drive, double dt) {
  const double grip = parameters_.friction * friction_scale * load;
  const double traction = kTractionShare * grip;
  Force force;
  force.along =
      std::clamp(drive + resist(along_speed, std::min(resistance, traction), dt), -traction, traction);
  across_capacity_ = std::sqrt(grip * grip - force.along * force.along);
  force.across = corner(along_speed, across_speed, load, dt);
  return force;
}

double AxleTyre::resist(double speed, double limit, double dt) {
  if (limit <= 0.0) {
    along_deflection_ = 0.0;
    return 0.0;
  }
  // Implicit in the deflection: stable at any speed, and exact in the steady state.
  const double stiffness = parameters_.longitudinal_stiffness;
  const double before = along_deflection_;
  const double sliding = limit / stiffness;
  const double after = (before + speed * dt) / (1.0 + std::abs(speed) * dt / sliding);
  along_deflection_ = std::clamp(after, -sliding, sliding);
  const double elastic = -stiffness * along_deflection_;
  if (std::abs(speed) >= kSlow) return elastic;
  const double rate = (along_deflection_ - before) / dt;
  const double damping = along_damping_ * (1.0 - std::abs(speed) / kSlow);
  return std::clamp(elastic - damping * rate, -limit, limit);
}

double AxleTyre::corner(double along_speed, double across_speed, double load, double dt) {
  if (across_capacity_ <= 0.0) {
    across_deflection_ = 0.0;
    return 0.0;
  }
  const double sigma = parameters_.relaxation_length;
  const double before = across_deflection_;
  slide_deflection_ = 3.0 * across_capacity_ * sigma / (parameters_.cornering_coefficient * load);
  const double speed = std::abs(along_speed);
  const double after = (before + across_speed * dt) / (1.0 + speed * dt / sigma);
  across_deflection_ = std::clamp(after, -slide_deflection_, slide_deflection_);
  const double rho = across_deflection_ / slide_deflection_;
  const double elastic = -across_capacity_ * rho * (3.0 - 3.0 * std::abs(rho) + rho * rho);
  if (speed >= kSlow) return elastic;
  const double rate = (across_deflection_ - before) / dt;
  const double damping = across_damping_ * (1.0 - speed / kSlow);
  return std::clamp(elastic - damping * rate, -across_capacity_, across_capacity_);
}

double AxleTyre::storedEnergy() const {
  const double along = 0.5 * parameters_.longitudinal_stiffness * along_deflection_ * along_deflection_;
  if (across_capacity_ <= 0.0) return along;
  const double rho = std::abs(across_deflection_ / slide_deflection_);
  return along + across_capacity_ * slide_deflection_ * rho * rho * (1.5 - rho + 0.25 * rho * rho);
}

}  // namespace tunnel_pilot::vehicle
