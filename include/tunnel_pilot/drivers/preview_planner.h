#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>

#include "tunnel_pilot/drivers/path_model.h"
#include "tunnel_pilot/geometry/path.h"

namespace tunnel_pilot::drivers {

struct PreviewWeights {
  double offset;       ///< [1/m^2]
  double heading;      ///< [1/rad^2]
  double slope;        ///< of the command's change over the way driven [m^2/rad^2]
  double slope_speed;  ///< lowest v that the slope is counted with [m/s]
  double terminal;     ///< factor on offset and heading at the horizon's end [1]
  double rate_share;   ///< of max_rate that is planned with late in the horizon [1]
  double sharp_speed;  ///< at which the sharpest bends are driven; faster, see rateLimit() [m/s]
};

/// Optimal preview: finds the command rates w over the horizon that minimise
///   sum of  q_y e_y^2 + q_psi (e_psi + beta)^2 + r (w / max(v, v_0))^2
/// along the previewed path, under |w| <= max_rate (later in the horizon less, which leaves room for
/// what the model does not know, and beyond v_0 no more a metre than at v_0: a truck that comes faster
/// slows down before a bend that needs more), for the truck's exact kinematics
///   theta_dot = (g v sin(gamma) + l_r gamma_dot) / (l_f cos(gamma) + l_r) + v d
///   e_psi_dot = theta_dot - v kappa cos(e_psi) / (1 - kappa e_y)
///   beta      = -v theta_dot / (g_0 C) + (g - 1) tan(gamma / 2)
///   e_y_dot   = v sin(e_psi + beta),   gamma_dot = sat((u - gamma) / lag),   u_dot = w
/// (Corke & Ridley 2001 in path-error form). g and d are measured. beta is the front axle's slip angle:
/// the tyres' quasi-static one, with C their cornering coefficient, and what a yaw gain g other than 1
/// tells of the slip if both axles share it alike (v_y = -v_yr in the slip form of the kinematics). On a
/// path that the steering can follow the optimum is the exact curvature inversion; where the path's
/// curvature steps, it steers ahead and rounds the step off. Method: one
/// differential-dynamic-programming sweep with a clamped scalar control (Tassa, Mansard & Todorov 2014,
/// "Control-limited DDP") per call, started from the last call's solution shifted in time.
class PreviewPlanner {
 public:
  static constexpr std::size_t kStages = 32;
  static constexpr double kSlowedDown = 8.0;  ///< stages until somebody has slowed the truck down

  PreviewPlanner(const TruckResponse& truck, const PreviewWeights& weights, double step);

  /// Command rate to apply from now on [rad/s]. `elapsed` [s] since the last plan shifts the start;
  /// speed [m/s] is held over the horizon. The path must not be empty.
  double plan(const PathState& now, const geometry::Path& path, double speed,
              const YawResponse& believed, double elapsed);
  void reset();  ///< the next plan starts from a standing command ...
  void resetToUnwinding(double command, double speed);  ///< ... from one that goes to zero

  void setMaxRate(double rate) { truck_.max_rate = rate; }  ///< for the plans to come [rad/s]
  /// The least share of a sweep's corrections that is tried [1]. A start far from the optimum needs less
  /// than one from the last plan.
  void setLeastCorrection(double share) { least_correction_ = share; }

  double cost() const { return cost_; }  ///< of the last plan
  /// The planned state `time` [s] after the last plan's start, interpolated; clamped to the horizon.
  PathState plannedAt(double time) const;

 private:
  using Vector = Eigen::Vector4d;  ///< (offset, heading error, articulation, command)
  struct Linear;                   ///< derivatives of one step

  /// One step of the plan.
  PathState advance(const PathState& state, double cos_heading_error, double command_rate, double speed,
                    double curvature, const YawResponse& believed) const;
  void shift(double elapsed);
  /// Follows the plan from `now`; with a `correction` above 0, first changes it by that share of the
  /// last sweep's corrections. Returns the cost.
  double roll(const PathState& now, const geometry::Path& path, double speed,
              const YawResponse& believed, double correction);
  void sweep(double speed, const YawResponse& believed);
  Linear linearise(const PathState& state, double rate, double speed, double curvature,
                   const YawResponse& believed) const;
  double rateWeight(double speed) const {
    const double v = std::max(speed, weights_.slope_speed);
    return weights_.slope / (v * v);
  }
  /// Late in the horizon a share. A truck that comes faster than the sharpest bends are driven will have
  /// slowed down before one of them: then more, as the squared speed.
  double rateLimit(std::size_t stage, double speed) const {
    const auto k = static_cast<double>(stage);
    const double faster = std::max(1.0, speed / weights_.sharp_speed);
    const double slowed = std::min(1.0, k / kSlowedDown) * (faster * faster - 1.0);
    return truck_.max_rate * std::max(weights_.rate_share, 1.0 - 0.10 * k) * (1.0 + slowed);
  }
  /// Heading error with which the course follows a path of this curvature despite the slip [rad].
  double courseOffset(double speed, double curvature, const YawResponse& believed) const;
  double stageCost(const PathState& state, double curvature, double speed,
                   const YawResponse& believed) const;

  TruckResponse truck_;
  PreviewWeights weights_;
  double step_;  ///< [s]
  double cost_ = 0.0;
  double least_correction_ = 0.25;
  double share_;  ///< of the way to the command that the articulation goes in one step [1]
  std::array<double, kStages> rates_{};       ///< the plan [rad/s]
  std::array<double, kStages> curvatures_{};  ///< met on the way [1/m]
  std::array<PathState, kStages + 1> states_{};
  std::array<double, kStages> nominal_rates_{};  ///< before the last sweep's correction
  std::array<PathState, kStages + 1> nominal_{};
  std::array<double, kStages> corrections_{};  ///< of the last sweep [rad/s]
  std::array<Vector, kStages> gains_{};        ///< feedback of the last sweep
};

}  // namespace tunnel_pilot::drivers
