#include "tunnel_pilot/learning/input_projection.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace tunnel_pilot::learning {
namespace {

// Components with less than this share of the greatest variance are no more amplified.
constexpr float kLeastVariance = 1e-7F;
// A single input that varies less than this among the examples tells nothing: a weight would be left as
// it was drawn, and act on whatever the input is later.
constexpr float kLeastSingleVariance = 1e-6F;

}  // namespace

InputProjection::InputProjection(const Eigen::MatrixXf& inputs, std::size_t beams,
                                 std::size_t components) {
  const auto rows = inputs.rows();
  const auto b = static_cast<Eigen::Index>(beams);
  const auto k = std::min(static_cast<Eigen::Index>(components), b);
  mean_ = inputs.rowwise().mean();
  const Eigen::MatrixXf centred = inputs.colwise() - mean_;
  const auto scans = centred.topRows(b);
  const Eigen::MatrixXf covariance = scans * scans.transpose() / static_cast<float>(inputs.cols());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf> solver(covariance);
  const float floor = kLeastVariance * solver.eigenvalues()[b - 1];
  basis_ = Eigen::MatrixXf::Zero(k + rows - b, rows);
  for (Eigen::Index i = 0; i < k; ++i) {
    const float variance = std::max(solver.eigenvalues()[b - 1 - i], 0.0F) + floor;
    basis_.row(i).head(b) = solver.eigenvectors().col(b - 1 - i).transpose() / std::sqrt(variance);
  }
  for (Eigen::Index i = b; i < rows; ++i) {
    const float variance = centred.row(i).squaredNorm() / static_cast<float>(inputs.cols());
    if (variance > kLeastSingleVariance) {
      basis_(k + i - b, i) = 1.0F / std::sqrt(variance + kLeastSingleVariance);
    }
  }
}

Eigen::MatrixXf InputProjection::project(const Eigen::MatrixXf& inputs) const {
  return basis_ * (inputs.colwise() - mean_);
}

void InputProjection::unfold(const neural::Network& inner, neural::Network& outer) const {
  const neural::Layer& first = inner.layers().front();
  const std::size_t hidden = first.channels_out;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> weights(inner.parameters().data(), static_cast<Eigen::Index>(hidden),
                                       basis_.rows());
  const Rows raw = weights * basis_.cast<double>();
  const Eigen::VectorXd shift = raw * mean_.cast<double>();
  std::vector<double>& parameters = outer.parameters();
  std::copy_n(raw.data(), raw.size(), parameters.begin());
  for (std::size_t h = 0; h < hidden; ++h) {
    parameters[static_cast<std::size_t>(raw.size()) + h] =
        inner.parameters()[first.weights() + h] - shift[static_cast<Eigen::Index>(h)];
  }
  std::copy(inner.parameters().begin() + static_cast<std::ptrdiff_t>(first.parameters()),
            inner.parameters().end(),
            parameters.begin() + static_cast<std::ptrdiff_t>(outer.layers().front().parameters()));
}

}  // namespace tunnel_pilot::learning
