#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::perception {

/// Least-squares parabolas  p(t) = a + b t + c t^2  through stretches of a polyline, t being the arc
/// length from a place on it. Prefix sums of the moments make each fit O(1).
class ArcLengthFit {
 public:
  struct Parabola {
    geometry::Point place;           ///< a [m]
    geometry::Point tangent;         ///< b, unit length but for the fit's error
    geometry::Point second;          ///< 2 c, the curvature vector [1/m]
    Eigen::Matrix3d inverse_normal;  ///< (A'A)^-1 of (a, b, c)

    double curvature() const {
      return (tangent.x() * second.y() - tangent.y() * second.x()) /
             (tangent.squaredNorm() * tangent.norm());
    }
  };

  void clear() {
    sums_.assign(1, {});
    s_.clear();
  }
  void add(const geometry::Point& point);

  std::size_t size() const { return s_.size(); }
  double s(std::size_t i) const { return s_[i]; }  ///< arc length at point i [m]

  /// Through points first..last (at least three), t counted from arc length `s0`.
  Parabola fit(std::size_t first, std::size_t last, double s0) const;

 private:
  // Sums of 1, s, s^2, s^3, s^4 and of x, x s, x s^2, y, y s, y s^2 over the points before.
  using Sums = std::array<double, 11>;

  geometry::Point last_ = geometry::Point::Zero();
  std::vector<double> s_;
  std::vector<Sums> sums_ = std::vector<Sums>(1);
};

}  // namespace tunnel_pilot::perception
