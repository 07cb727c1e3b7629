#pragma once

#include <Eigen/Core>
#include <cmath>

namespace tunnel_pilot::geometry {

using Point = Eigen::Vector2d;  ///< x, y [m]

/// Wraps an angle into (-pi, pi] [rad]. Nearly all angles lie there already.
double wrapAnyAngle(double angle);
inline double wrapAngle(double angle) {
  return angle > -M_PI && angle <= M_PI ? angle : wrapAnyAngle(angle);
}

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

/// A pose with sine and cosine of its heading taken once, for work on many points.
class Frame {
 public:
  explicit Frame(const Pose& pose)
      : pose_(pose), cosine_(std::cos(pose.heading)), sine_(std::sin(pose.heading)) {}

  const Pose& pose() const { return pose_; }
  Point direction() const { return {cosine_, sine_}; }  ///< unit, along the x axis

  Point transform(const Point& local) const {
    return {pose_.x + cosine_ * local.x() - sine_ * local.y(),
            pose_.y + sine_ * local.x() + cosine_ * local.y()};
  }
  Point inverseTransform(const Point& parent) const {
    const double dx = parent.x() - pose_.x;
    const double dy = parent.y() - pose_.y;
    return {cosine_ * dx + sine_ * dy, -sine_ * dx + cosine_ * dy};
  }
  Pose compose(const Pose& next) const {
    const Point p = transform(next.position());
    return {p.x(), p.y(), wrapAngle(pose_.heading + next.heading)};
  }

  /// The same heading at another place, given in this frame.
  Frame shifted(const Point& local) const {
    Frame other = *this;
    const Point p = transform(local);
    other.pose_.x = p.x();
    other.pose_.y = p.y();
    return other;
  }

 private:
  Pose pose_;
  double cosine_;
  double sine_;
};

}  // namespace tunnel_pilot::geometry
