#include "tunnel_pilot/ros/sensor_pose.h"

#include <tf2/LinearMath/Matrix3x3.h>
#include <tf2/LinearMath/Quaternion.h>

#include <cmath>

#include "tunnel_pilot/ros/conversions.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kLargestTilt = 0.1;  // [rad]

}  // namespace

std::optional<geometry::Pose> planarMounting(const geometry_msgs::Transform& transform,
                                             std::string& why_not) {
  const auto& p = transform.translation;
  const auto& r = transform.rotation;
  const double norm = std::sqrt(r.x * r.x + r.y * r.y + r.z * r.z + r.w * r.w);
  if (!std::isfinite(p.x + p.y + p.z) || !(std::abs(norm - 1.0) < 1e-3)) {
    why_not = "its transform to base_link is not finite or its rotation is no unit quaternion";
    return std::nullopt;
  }
  const tf2::Matrix3x3 rotation(tf2::Quaternion(r.x, r.y, r.z, r.w));
  if (rotation[2][2] < std::cos(kLargestTilt)) {
    why_not = "it is mounted tilted or upside down; a flat, upright lidar is needed";
    return std::nullopt;
  }
  return geometry::Pose{p.x, p.y, std::atan2(rotation[1][0], rotation[0][0])};
}

SensorPose::SensorPose()
    : buffer_(std::make_unique<tf2_ros::Buffer>()),
      listener_(std::make_unique<tf2_ros::TransformListener>(*buffer_)) {}

std::optional<geometry::Pose> SensorPose::find(const std::string& frame) {
  if (pose_) {
    if (frame == frame_) return pose_;
    why_not_ = "the scan's frame changed from '" + frame_ + "' to '" + frame + "'";
    return std::nullopt;
  }
  try {
    const auto found = buffer_->lookupTransform(kBaseFrame, frame, ros::Time(0));
    pose_ = planarMounting(found.transform, why_not_);
    if (!pose_) why_not_ = "sensor '" + frame + "': " + why_not_;
  } catch (const tf2::TransformException& e) {
    why_not_ = "no transform from '" + std::string(kBaseFrame) + "' to the sensor: " + e.what();
  }
  if (!pose_) return std::nullopt;
  frame_ = frame;
  why_not_.clear();
  listener_.reset();
  buffer_.reset();
  return pose_;
}

}  // namespace tunnel_pilot::shell
