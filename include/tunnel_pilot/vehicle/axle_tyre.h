#pragma once

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// The tyres of one axle as a pair of springs between rim and road, which keeps them well-behaved from
/// top speed down to standstill. v_x, v_y are the axle's speeds along and across its wheels [m/s].
/// Lateral (relaxation length sigma, e.g. Pacejka; brush saturation, Fromm/Pacejka):
///   u' = v_y - |v_x| u / sigma,    steady: u / sigma = tan(slip angle)
///   F_y = -cap (3 rho - 3 rho |rho| + rho^3),  rho = C_alpha (u / sigma) / (3 cap) in [-1, 1],
///   C_alpha = coefficient F_z,  cap = sqrt((mu F_z)^2 - F_x^2)
/// so that F_y = -C_alpha alpha for small slip. Resisting (brakes and rolling; Dahl friction):
///   z' = v_x - |v_x| k z / F_c,    F = -k z,    |k z| <= F_c
/// Both springs are damped near standstill. Neither can create energy at constant load. Traction control
/// keeps |F_x| <= 0.95 mu F_z. Forces [N], on the vehicle, along and across the wheels.
class AxleTyre {
 public:
  struct Force {
    double along = 0.0;
    double across = 0.0;
  };

  /// `static_load` sets the springs' damping near standstill [N].
  AxleTyre(const TyreParameters& parameters, double static_load);

  void reset();

  /// `load` is F_z, `resistance` the Coulomb force F_c of brakes and rolling, `drive` the drive force.
  Force step(double along_speed, double across_speed, double load, double friction_scale,
             double resistance, double drive, double dt);

  /// Energy stored in the springs since the last step [J].
  double storedEnergy() const;

 private:
  double resist(double speed, double limit, double dt);
  double corner(double along_speed, double across_speed, double load, double dt);

  TyreParameters parameters_;
  double along_damping_;            // [N s/m]
  double across_damping_;           // [N s/m]
  double along_deflection_ = 0.0;   // z [m]
  double across_deflection_ = 0.0;  // u [m]
  double across_capacity_ = 0.0;    // cap [N]
  double slide_deflection_ = 0.0;   // u at which the whole contact slides [m]
};

}  // namespace tunnel_pilot::vehicle
