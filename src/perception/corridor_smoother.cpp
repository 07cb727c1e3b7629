#include "corridor_smoother.h"

#include <Eigen/LU>
#include <algorithm>

namespace tunnel_pilot::perception {
namespace {

// The transition over length l is F = [1 l l^2/2 0; 0 1 l 0; 0 0 1 0; 0 0 0 1]. P <- P F': by columns.
void timesTransposedTransition(double l, CorridorSmoother::Matrix& p) {
  p.col(0) += l * p.col(1) + 0.5 * l * l * p.col(2);
  p.col(1) += l * p.col(2);
}

// P <- F P: by rows.
void transitionTimes(double l, CorridorSmoother::Matrix& p) {
  p.row(0) += l * p.row(1) + 0.5 * l * l * p.row(2);
  p.row(1) += l * p.row(2);
}

}  // namespace

void CorridorSmoother::start(const CorridorNode& node, const Vector& deviations) {
  steps_.clear();
  Step step;
  step.node = step.predicted = node;
  step.covariance = step.predicted_covariance = deviations.cwiseAbs2().asDiagonal();
  step.length = 0.0;
  steps_.push_back(step);
}

void CorridorSmoother::advance(double length) {
  const Step& from = steps_.back();
  Step to;
  to.length = length;
  to.predicted = from.node;
  to.predicted.move(length);
  to.predicted_covariance = from.covariance;
  timesTransposedTransition(length, to.predicted_covariance);
  transitionTimes(length, to.predicted_covariance);
  // White noise of curvature's rate, integrated over the step (e, psi, kappa).
  const double l = length;
  const double q = curvature_noise_;
  Matrix& p = to.predicted_covariance;
  p(0, 0) += q * l * l * l * l * l / 20.0;
  p(0, 1) += q * l * l * l * l / 8.0;
  p(0, 2) += q * l * l * l / 6.0;
  p(1, 1) += q * l * l * l / 3.0;
  p(1, 2) += q * l * l / 2.0;
  p(2, 2) += q * l;
  p(1, 0) = p(0, 1);
  p(2, 0) = p(0, 2);
  p(2, 1) = p(1, 2);
  p(3, 3) += width_noise_ * l;
  to.node = to.predicted;
  to.covariance = p;
  steps_.push_back(to);
}

double CorridorSmoother::expectedVariance(double side) const {
  const Matrix& p = steps_.back().covariance;
  return p(0, 0) + 2.0 * side * p(0, 3) + p(3, 3);
}

// The wall is an offset curve of the centerline: y(x) = e + side h + psi x + kappa_w x^2 / 2 with the
// wall's own curvature kappa_w = kappa / (1 - side h kappa), near to kappa for the Jacobian's sake.
void CorridorSmoother::measure(double side, const Slice& slice, double variance) {
  Step& step = steps_.back();
  const CorridorNode& node = step.node;
  const double bend = node.curvature / std::max(0.2, 1.0 - side * node.half_width * node.curvature);
  const double innovation = slice.lateral - side * node.half_width - 0.5 * slice.along_squared * bend;
  const Vector jacobian(1.0, slice.along, 0.5 * slice.along_squared, side);
  const Vector ph = step.covariance * jacobian;
  const Vector gain = ph / (jacobian.dot(ph) + variance);
  step.covariance.noalias() -= gain * ph.transpose();
  fold(gain * innovation, step.node);
}

void CorridorSmoother::rewind(std::size_t count) {
  steps_.resize(count);
  steps_.back().node = steps_.back().predicted;
  steps_.back().covariance = steps_.back().predicted_covariance;
}

void CorridorSmoother::step(double shift, double half_width, double shift_deviation,
                            double width_deviation) {
  Step& last = steps_.back();
  fold({shift, 0.0, 0.0, half_width - last.predicted.half_width}, last.predicted);
  last.predicted_covariance(0, 0) += shift_deviation * shift_deviation;
  last.predicted_covariance(3, 3) += width_deviation * width_deviation;
  last.node = last.predicted;
  last.covariance = last.predicted_covariance;
}

void CorridorSmoother::fold(const Vector& error, CorridorNode& node) {
  node.position += error(0) * node.direction.left();
  node.direction = node.direction.turned(error(1));
  node.curvature += error(2);
  node.half_width += error(3);
}

void CorridorSmoother::smooth() {
  for (std::size_t i = steps_.size() - 1; i-- > 0;) {
    Step& step = steps_[i];
    const Step& next = steps_[i + 1];
    Matrix cross = step.covariance;
    timesTransposedTransition(next.length, cross);
    const Matrix gain = cross * next.predicted_covariance.inverse();
    const CorridorNode& expected = next.predicted;
    const Vector correction((next.node.position - expected.position).dot(expected.direction.left()),
                            next.node.direction.angle() - expected.direction.angle(),
                            next.node.curvature - expected.curvature,
                            next.node.half_width - expected.half_width);
    fold(gain * correction, step.node);
    step.covariance += gain * (next.covariance - next.predicted_covariance) * gain.transpose();
  }
}

}  // namespace tunnel_pilot::perception
