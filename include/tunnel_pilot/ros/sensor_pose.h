#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <memory>
#include <optional>
#include <string>

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::shell {

/// The planar part of a sensor's mounting, or why it cannot be used: a planar lidar must lie flat and
/// upright (its z axis within 0.1 rad of base_link's), and the numbers must be finite.
std::optional<geometry::Pose> planarMounting(const geometry_msgs::Transform& transform,
                                             std::string& why_not);

/// Pose of a sensor in base_link, looked up once in TF and then kept: a sensor does not move on its
/// body.
class SensorPose {
 public:
  SensorPose();

  /// The pose of `frame` in base_link, or nothing, with the reason in whyNot(). A frame other than the
  /// first that was found is refused.
  std::optional<geometry::Pose> find(const std::string& frame);

  const std::string& whyNot() const { return why_not_; }

 private:
  std::string frame_;
  std::optional<geometry::Pose> pose_;
  std::string why_not_;
  // Gone once the pose is known: TF's traffic then costs this stage nothing.
  std::unique_ptr<tf2_ros::Buffer> buffer_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
};

}  // namespace tunnel_pilot::shell
