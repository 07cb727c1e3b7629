#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/JointState.h>

#include <optional>

#include "tunnel_pilot/drivers/driver.h"

namespace tunnel_pilot::shell {

/// Makes one motion of the two topics that tell it: `odom` (pose, speed, yaw rate) and `joint_states`
/// (articulation and, where the publisher knows it, its rate; otherwise the rate is the difference of
/// the last two). The motion's stamp is the older of the two. Other joints' messages are passed over;
/// numbers that are not finite are passed on, for the arbiter stops at once for them.
class MotionInput {
 public:
  void setJointState(const sensor_msgs::JointState& message);
  void setOdometry(const nav_msgs::Odometry& message);
  void reset();

  /// Nothing until both topics have spoken.
  std::optional<drivers::Motion> motion() const;

 private:
  struct Joint {
    Stamp stamp{};
    double angle = 0.0;  // [rad]
    double rate = 0.0;   // [rad/s]
  };
  std::optional<Joint> joint_;
  std::optional<drivers::Motion> odometry_;
};

/// Brings together the two topics that tell of one scan, `tunnel_state` and `centerline`, by their
/// stamp.
class TunnelInput {
 public:
  void setState(const perception::TunnelState& state) { state_ = state; }
  void setCenterline(Stamp stamp, geometry::Path centerline);
  void reset();

  /// The tunnel, once, when both parts of it have come.
  std::optional<perception::Tunnel> take();

 private:
  std::optional<perception::TunnelState> state_;
  std::optional<Stamp> centerline_stamp_;
  geometry::Path centerline_;
};

}  // namespace tunnel_pilot::shell
