#include "tunnel_pilot/vehicle/hinge_compliance.h"

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <stdexcept>

namespace tunnel_pilot::vehicle {
namespace {

using Complex = std::complex<double>;

// A(s) of the straight-running loaded truck at `speed` [m/s].
Eigen::Matrix3cd motionMatrix(const TruckParameters& truck, double speed, Complex s) {
  const TruckMasses& m = truck.loaded;
  const double b_f = m.front * m.front_cg_offset;
  const double b_r = m.rear * m.rear_cg_offset;
  Eigen::Matrix3d mass;
  mass << m.front + m.rear, b_f, -b_r,                      //
      b_f, m.front_inertia + b_f * m.front_cg_offset, 0.0,  //
      -b_r, 0.0, m.rear_inertia + b_r * m.rear_cg_offset;
  Eigen::Matrix3cd a = mass.cast<Complex>() * s * s;

  // Axle at x from the hinge on body i: it slips by s y + (x s - U) theta_i, and pushes back with
  // C_alpha / (sigma s + U) of it, on y and with the arm x on theta_i.
  const AxleLoads loads = staticAxleLoads(truck, Load::kLoaded);
  const auto addAxle = [&](int body, double x, double load) {
    const Complex gain =
        truck.tyre.cornering_coefficient * load / (truck.tyre.relaxation_length * s + speed);
    a(0, 0) += gain * s;
    a(0, body) += gain * (x * s - speed);
    a(body, 0) += x * gain * s;
    a(body, body) += x * gain * (x * s - speed);
  };
  addAxle(1, truck.geometry.front_axle_to_hinge, loads.front);
  addAxle(2, -truck.geometry.rear_axle_to_hinge, loads.rear);
  return a;
}

}  // namespace

HingeCompliance hingeCompliance(const TruckParameters& truck) {
  const double zeta = truck.steering.compliance_damping;
  const double omega = 2.0 * M_PI * truck.steering.compliance_frequency;
  const Complex s = omega * Complex(-zeta, std::sqrt(1.0 - zeta * zeta));
  const Eigen::Vector3cd b(0.0, 1.0, -1.0);
  const Eigen::Vector3cd response =
      motionMatrix(truck, truck.steering.compliance_speed, s).partialPivLu().solve(b);
  const Complex impedance = -1.0 / (response(1) - response(2));
  const double damping = impedance.imag() / s.imag();
  const double stiffness = impedance.real() - damping * s.real();
  if (!(stiffness > 0.0 && damping >= 0.0)) {
    throw std::invalid_argument(
        "no hinge spring and damper give the truck this compliance_frequency and compliance_damping at "
        "compliance_speed");
  }
  return {stiffness, damping};
}

}  // namespace tunnel_pilot::vehicle
