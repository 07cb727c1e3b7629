#pragma once

#include <Eigen/Core>

namespace tunnel_pilot::geometry {

using Point = Eigen::Vector2d;  ///< x, y [m]

/// Wraps an angle into (-pi, pi] [rad].
double wrapAngle(double angle);

/// A planar pose: position [m] and heading [rad], x forward, y left, counter-clockwise positive
/// (REP-103). Seen as a transform, it takes coordinates of the pose's own frame to those of the frame it
/// is given in.
struct Pose {
  double x = 0.0;        ///< [m]
  double y = 0.0;        ///< [m]
  double heading = 0.0;  ///< [rad]

  Point position() const { return {x, y}; }

  /// Coordinates of `local` (in this pose's frame) in the parent frame.
  Point transform(const Point& local) const;

  /// Coordinates of `parent` (in the parent frame) in this pose's frame.
  Point inverseTransform(const Point& parent) const;

  /// This pose followed by `next` (given in this pose's frame). The heading is wrapped.
  Pose compose(const Pose& next) const;

  /// The pose `p` such that compose(p) equals `other`.
  Pose relative(const Pose& other) const;
};

}  // namespace tunnel_pilot::geometry
