#include "arc_length_fit.h"

namespace tunnel_pilot::perception {

void ArcLengthFit::add(const geometry::Point& point) {
  const double s = s_.empty() ? 0.0 : s_.back() + (point - last_).norm();
  last_ = point;
  s_.push_back(s);
  const double x = point.x();
  const double y = point.y();
  const double ss = s * s;
  const Sums terms = {1.0, s, ss, ss * s, ss * ss, x, x * s, x * ss, y, y * s, y * ss};
  Sums sums = sums_.back();
  for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += terms[k];
  sums_.push_back(sums);
}

ArcLengthFit::Parabola ArcLengthFit::fit(std::size_t first, std::size_t last, double s0) const {
  Sums m = sums_[last + 1];
  for (std::size_t k = 0; k < m.size(); ++k) m[k] -= sums_[first][k];
  // Moments about s0: sums of (s - s0)^k by the binomial theorem.
  const double n = m[0];
  const double t1 = m[1] - s0 * n;
  const double t2 = m[2] - 2.0 * s0 * m[1] + s0 * s0 * n;
  const double t3 = m[3] - 3.0 * s0 * m[2] + 3.0 * s0 * s0 * m[1] - s0 * s0 * s0 * n;
  const double t4 =
      m[4] - 4.0 * s0 * m[3] + 6.0 * s0 * s0 * m[2] - 4.0 * s0 * s0 * s0 * m[1] + s0 * s0 * s0 * s0 * n;
  // Inverse of the symmetric matrix [n t1 t2; t1 t2 t3; t2 t3 t4] by its adjugate.
  const double a00 = t2 * t4 - t3 * t3;
  const double a01 = t2 * t3 - t1 * t4;
  const double a02 = t1 * t3 - t2 * t2;
  const double a11 = n * t4 - t2 * t2;
  const double a12 = t1 * t2 - n * t3;
  const double a22 = n * t2 - t1 * t1;
  const double per_determinant = 1.0 / (n * a00 + t1 * a01 + t2 * a02);
  Parabola fit;
  fit.inverse_normal << a00, a01, a02, a01, a11, a12, a02, a12, a22;
  fit.inverse_normal *= per_determinant;
  const auto solve = [&](double q0, double q1, double q2) {
    return Eigen::Vector3d(fit.inverse_normal *
                           Eigen::Vector3d(q0, q1 - s0 * q0, q2 - 2.0 * s0 * q1 + s0 * s0 * q0));
  };
  const Eigen::Vector3d x = solve(m[5], m[6], m[7]);
  const Eigen::Vector3d y = solve(m[8], m[9], m[10]);
  fit.place = {x(0), y(0)};
  fit.tangent = {x(1), y(1)};
  fit.second = {2.0 * x(2), 2.0 * y(2)};
  return fit;
}

}  // namespace tunnel_pilot::perception
