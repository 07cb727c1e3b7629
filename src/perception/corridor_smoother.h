#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::perception {

/// A direction with its cosine and sine, which small turns keep up by their series instead of calling
/// the library: turning by 0.1 rad leaves an error below 1e-7.
class Direction {
 public:
  Direction() = default;
  explicit Direction(double angle) : angle_(angle), cosine_(std::cos(angle)), sine_(std::sin(angle)) {}

  double angle() const { return angle_; }  ///< [rad], not wrapped
  double cosine() const { return cosine_; }
  double sine() const { return sine_; }
  geometry::Point along() const { return {cosine_, sine_}; }
  geometry::Point left() const { return {-sine_, cosine_}; }

  Direction turned(double angle) const {
    if (std::abs(angle) > 0.1) return Direction(angle_ + angle);
    const double square = angle * angle;
    const double c = 1.0 - 0.5 * square * (1.0 - square / 12.0);
    const double s = angle * (1.0 - square / 6.0 * (1.0 - square / 20.0));
    Direction result;
    result.angle_ = angle_ + angle;
    result.cosine_ = cosine_ * c - sine_ * s;
    result.sine_ = sine_ * c + cosine_ * s;
    return result;
  }

 private:
  double angle_ = 0.0;
  double cosine_ = 1.0;
  double sine_ = 0.0;
};

/// The tunnel at one place along it.
struct CorridorNode {
  geometry::Point position = geometry::Point::Zero();  ///< of the centerline [m]
  Direction direction;                                 ///< of the tunnel
  double curvature = 0.0;                              ///< [1/m]
  double half_width = 0.0;                             ///< [m]

  /// Goes `length` [m] along the arc.
  void move(double length) {
    position += length * direction.turned(0.5 * length * curvature).along();
    direction = direction.turned(length * curvature);
  }
};

/// Extended Kalman filter along a tunnel with a Rauch-Tung-Striebel smoother. The error state of a node
/// is (lateral offset e, heading psi, curvature kappa, half width h) in the node's own frame; a
/// measurement folds it into the node at once, so that it starts from zero again.
class CorridorSmoother {
 public:
  using Vector = Eigen::Matrix<double, 4, 1>;
  using Matrix = Eigen::Matrix<double, 4, 4>;

  /// `curvature_noise` [1/m^2 per m], `width_noise` [m^2 per m]: what the variances grow by.
  CorridorSmoother(double curvature_noise, double width_noise)
      : curvature_noise_(curvature_noise), width_noise_(width_noise) {}

  void start(const CorridorNode& node, const Vector& deviations);
  void setWidthNoise(double width_noise) { width_noise_ = width_noise; }
  /// Appends the node `length` [m] farther on.
  void advance(double length);
  /// A wall's mean place in a slice across the tunnel, in the node's frame.
  struct Slice {
    double along = 0.0;          ///< mean of x [m]
    double along_squared = 0.0;  ///< mean of x^2 [m^2]
    double lateral = 0.0;        ///< mean of y [m]
  };
  /// Measures a wall of the last node; `side` +1 left, -1 right.
  void measure(double side, const Slice& slice, double variance);
  /// The tunnel changes its width at the last node: a known step, which the smoother does not spread.
  void step(double shift, double half_width, double shift_deviation, double width_deviation);
  /// Variance with which the wall of the last node is expected [m^2].
  double expectedVariance(double side) const;
  /// Runs back over all nodes; afterwards node(i) is the smoothed one.
  void smooth();

  std::size_t size() const { return steps_.size(); }
  const CorridorNode& node(std::size_t i) const { return steps_[i].node; }
  const CorridorNode& last() const { return steps_.back().node; }
  const Matrix& covariance(std::size_t i) const { return steps_[i].covariance; }
  /// Forgets the nodes after the first `count`, and what was measured at the last of these.
  void rewind(std::size_t count);

 private:
  struct Step {
    CorridorNode node;  // filtered, later smoothed
    Matrix covariance;
    CorridorNode predicted;  // before this node's measurements
    Matrix predicted_covariance;
    double length;  // from the node before [m]
    EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  };

  static void fold(const Vector& error, CorridorNode& node);

  double curvature_noise_;
  double width_noise_;
  std::vector<Step, Eigen::aligned_allocator<Step>> steps_;
};

}  // namespace tunnel_pilot::perception
