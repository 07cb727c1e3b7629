#include "tunnel_pilot/ros/motion_input.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tunnel_pilot/ros/conversions.h"

namespace tunnel_pilot::shell {

void MotionInput::setJointState(const sensor_msgs::JointState& message) {
  const auto found = std::find(message.name.begin(), message.name.end(), kArticulationJoint);
  const auto index = static_cast<std::size_t>(found - message.name.begin());
  if (found == message.name.end() || index >= message.position.size()) return;
  Joint joint;
  joint.stamp = toCore(message.header.stamp);
  joint.angle = message.position[index];
  if (index < message.velocity.size()) {
    joint.rate = message.velocity[index];
  } else if (joint_ && joint.stamp > joint_->stamp && std::isfinite(joint_->angle)) {
    joint.rate = (joint.angle - joint_->angle) / toSeconds(joint.stamp - joint_->stamp);
  }
  joint_ = joint;
}

void MotionInput::setOdometry(const nav_msgs::Odometry& message) { odometry_ = toMotion(message); }

void MotionInput::reset() {
  joint_.reset();
  odometry_.reset();
}

std::optional<drivers::Motion> MotionInput::motion() const {
  if (!joint_ || !odometry_) return std::nullopt;
  drivers::Motion motion = *odometry_;
  motion.stamp = std::min(odometry_->stamp, joint_->stamp);
  motion.articulation = joint_->angle;
  motion.articulation_rate = joint_->rate;
  return motion;
}

void TunnelInput::setCenterline(Stamp stamp, geometry::Path centerline) {
  centerline_stamp_ = stamp;
  centerline_ = std::move(centerline);
}

void TunnelInput::reset() {
  state_.reset();
  centerline_stamp_.reset();
}

std::optional<perception::Tunnel> TunnelInput::take() {
  if (!state_ || !centerline_stamp_ || state_->stamp != *centerline_stamp_) return std::nullopt;
  perception::Tunnel tunnel{*state_, std::move(centerline_)};
  reset();
  return tunnel;
}

}  // namespace tunnel_pilot::shell
