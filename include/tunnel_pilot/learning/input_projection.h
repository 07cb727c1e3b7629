#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "tunnel_pilot/learning/data_set.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::learning {

/// The principal components of a data set's scans, scaled to unit variance (whitening): neighbouring
/// beams say nearly the same, which makes a first layer on raw ranges slow to train. A dense first layer
/// trained on the components is turned into the same layer on the raw inputs afterwards:
///   W_raw = W B,  b_raw = b - W B mean,  with z = B (x - mean).
/// Single inputs (articulation, speed) are only centred and scaled; one that is the same in all examples
/// gets no weight.
class InputProjection {
 public:
  /// `inputs`: one column an example, the first `beams` rows its scan. Keeps `components` components.
  InputProjection(const Eigen::MatrixXf& inputs, std::size_t beams, std::size_t components);

  std::size_t size() const { return static_cast<std::size_t>(basis_.rows()); }
  Eigen::MatrixXf project(const Eigen::MatrixXf& inputs) const;

  /// `inner` takes size() values; its first layer's parameters on raw inputs go to `outer`, those of the
  /// other layers unchanged.
  void unfold(const neural::Network& inner, neural::Network& outer) const;

 private:
  Eigen::VectorXf mean_;
  Eigen::MatrixXf basis_;  ///< B
};

}  // namespace tunnel_pilot::learning
