#pragma once

#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/path_predictor.h"
#include "tunnel_pilot/drivers/preview_network.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// Drives along the measured centerline by the paper's driver model (paper 000, figures 5 to 7):
/// preview, a 4-10-1 network, correction and delay. Each scan it finds where the truck will be beside
/// the path when a new command acts (PathPredictor: this is e^(-T_d s), predicted away) and there, at
/// speed v, with the path f(t) straightened along its arc and seen from its tangent at the foot point,
///   preview     f_e = (5 / T_p^3) int_0^T_p tau^2 f(t + tau) d tau
///   truck       y = e_y,  y' = v sin(e_psi + beta),  y'' = v^2 (g sin(gamma) / a + d),
///               a = l_f cos(gamma) + l_r;  g, d and beta as in PreviewPlanner
///   network     u(f_e, y'', y', y), the steady articulation for the lateral acceleration it wants at
///   the
///               speed v_0 that it is for; at v it is gamma* = (v_0 / v)^2 u, as C_0 = (l_f + l_r) / v^2
///               (of it) is
///   correction  (1 + T_c s) / (1 + T_h s) with what the truck does: T_h = l_r / v is its turning with
///   the
///               hinge, in exact form (the curvature inversion), T_c makes up for the steering's lag:
///               gamma' = v [gamma* a / (l_f + l_r) - g sin(gamma) - d a] / l_r,
///               command = gamma + T_c gamma'
/// with gamma' and the command's rate held within max_rate. f_e is the preview of the least mean square
/// of f - y_p over T_p for constant lateral acceleration (MacAdam 1981; Guo's preview of whole
/// stretches). If its adaptation is on, the network learns from e = -y at every scan. Invalid proposals:
/// no valid or fresh tunnel, no motion, non-finite input. Never throws after construction, allocates
/// nothing.
class NeuralPreviewDriver : public PathDriver {
 public:
  static constexpr double kNetworkSpeed = 15.0 / 3.6;  ///< v_0 [m/s]

  /// Throws config::ConfigError when the parameters' network is none of 4-10-1 for this driver.
  NeuralPreviewDriver(const PreviewDriverParameters& parameters, const vehicle::TruckGeometry& geometry);

  Proposal propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) override;
  void reset() override;

  const PreviewNetwork& network() const { return network_; }

 private:
  PreviewInputs inputsAt(const PathState& place, const geometry::Path& path, double speed) const;
  /// Articulation rate that makes `wanted` of the steady articulation [rad/s].
  double turnTowards(double wanted, double articulation, double speed) const;

  PreviewDriverParameters parameters_;
  PathPredictor predictor_;
  PreviewNetwork network_;
};

/// f_e over `distance` [m] ahead of arc length `s`, for a path that is not empty [m].
double roadPreview(const geometry::Path& path, double s, double distance);

}  // namespace tunnel_pilot::drivers
