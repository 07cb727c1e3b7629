#pragma once

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// Spring and damper between the steering cylinders and the hinge (oil, hoses, linkage).
struct HingeCompliance {
  double stiffness;  ///< k_s [N m/rad]
  double damping;    ///< c_s [N m s/rad]
};

/// The spring and damper that give the loaded truck's snaking mode its stated frequency f and damping
/// ratio zeta at the stated speed U, both bodies and the tyres taking part. With q = (hinge y, theta_f,
/// theta_r) the straight-running truck is [A(s) + (k_s + c_s s) b b^T] q = 0, b = (0, 1, -1), where A
/// holds inertias and tyres (relaxation included). The compliance enters with rank one, so a root at s =
/// 2 pi f (-zeta + i sqrt(1 - zeta^2)) needs just
///   k_s + c_s s = -1 / (b^T A(s)^-1 b),
/// whose imaginary part gives c_s and whose real part k_s. Throws std::invalid_argument when no passive
/// spring and damper can do it.
HingeCompliance hingeCompliance(const TruckParameters& truck);

}  // namespace tunnel_pilot::vehicle
