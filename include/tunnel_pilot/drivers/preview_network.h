#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/neural/inference.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::drivers {

/// What the paper's driver model sees, in the frame of the path's tangent at the truck's foot point.
struct PreviewInputs {
  double road_preview;          ///< f_e, where the path goes, left of its tangent [m]
  double lateral_acceleration;  ///< y'' [m/s^2]
  double lateral_speed;         ///< y' [m/s]
  double lateral_position;      ///< y [m]
};

/// How the network learns while it drives (config/preview_driver.yaml).
struct AdaptationParameters {
  bool enabled;
  double rate;      ///< eta of one preview time [rad/m]
  double momentum;  ///< alpha [1]
  double bound;     ///< of a weight's way from its trained value [rad]
};

/// The 4-10-1 network of a driver who looks ahead (Guo's preview optimised simple neural network): four
/// scaled inputs, ten sigmoid nodes h_j, a linear output u = sum_j w_j h_j + b. It is for one speed; at
/// another one the driver scales its output as the preview theory scales articulation with speed.
/// While driving, it may learn by the paper's rule for E = e^2 / 2, e = y_m - y:
///   delta w_j(k) = eta e(k) sign(dy/du) h_j,   w_j(k) = w_j(k-1) + delta w_j(k) + alpha [w_j(k-1) -
///   w_j(k-2)]
/// with the momentum as the rule means it (as printed, it is but a higher rate), and sign(dy/du) = 1:
/// more articulation is more to the left. Weights stay within `bound` of the trained ones. Allocates
/// nothing after construction.
class PreviewNetwork {
 public:
  static constexpr std::size_t kInputs = 4;
  static constexpr std::size_t kHidden = 10;
  using Hidden = std::array<double, kHidden>;

  /// Throws config::ConfigError when the file's network is no 4-10-1 network of these inputs and output.
  PreviewNetwork(const neural::NetworkFile& file, const AdaptationParameters& adaptation);

  /// Articulation asked for, at the network's own speed [rad].
  double run(const PreviewInputs& inputs);

  /// One step of the rule for what run() saw last, `error` = y_m - y [m], over `share` of a preview time
  /// [1]. An error that is not finite teaches nothing.
  void learn(double error, double share);
  void reset();  ///< to the trained weights

  const Hidden& weights() const { return weights_; }
  const Hidden& hidden() const { return hidden_; }  ///< h_j of the last run

 private:
  AdaptationParameters adaptation_;
  std::array<neural::InputGroup, kInputs> scaling_;
  neural::Inference hidden_layer_;
  Hidden trained_{}, weights_{}, before_{};  ///< w_j: of the file, now, a step ago [rad]
  double bias_;                              ///< [rad]
  Hidden hidden_{};
};

/// The inputs, in the order in which a preview network takes them, for ranges of +-`range` each.
std::vector<neural::InputGroup> previewInputGroups(const PreviewInputs& range);

}  // namespace tunnel_pilot::drivers
