#include "tunnel_pilot/ros/wall_segmentation_ros.h"

#include <ros/console.h>

#include <boost/make_shared.hpp>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {

WallSegmentationRos::WallSegmentationRos(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : segmentation_(perception::loadWallSegmentation(Parameters(private_nh).rest())),
      publisher_(nh.advertise<Walls>("walls", 1)),
      subscriber_(nh.subscribe("points", 1, &WallSegmentationRos::onPoints, this,
                               ros::TransportHints().tcpNoDelay())),
      diagnostics_(nh, private_nh, "wall_segmentation", [this](auto& status) { fillStatus(status); }) {}

void WallSegmentationRos::onPoints(const sensor_msgs::PointCloud2& message) {
  const auto cloud = message.header.frame_id == kBaseFrame ? toCore(message) : nullptr;
  last_refused_ = cloud == nullptr;
  if (last_refused_) {
    ++refused_;
    ROS_ERROR_THROTTLE(1.0,
                       "wall_segmentation: a cloud in frame '%s' is refused: it must be in '%s' and "
                       "hold x, y, z",
                       message.header.frame_id.c_str(), kBaseFrame);
    return;
  }
  ++clouds_;
  segmentation_.setInputCloud(cloud);
  const auto& walls = segmentation_.segment(toCore(message.header.stamp));
  left_ = walls.left.found;
  right_ = walls.right.found;
  publisher_.publish(boost::make_shared<Walls>(toRos(walls, *cloud)));
}

void WallSegmentationRos::fillStatus(Diagnostics::Status& status) const {
  if (last_refused_) {
    status.summary(Diagnostics::Status::ERROR, "cloud refused");
  } else if (clouds_ == 0) {
    status.summary(Diagnostics::Status::WARN, "no cloud yet");
  } else if (left_ && right_) {
    status.summary(Diagnostics::Status::OK, "both walls found");
  } else if (left_ || right_) {
    status.summary(Diagnostics::Status::WARN, left_ ? "left wall only" : "right wall only");
  } else {
    status.summary(Diagnostics::Status::WARN, "no wall found");
  }
  status.add("clouds", clouds_);
  status.add("refused", refused_);
}

}  // namespace tunnel_pilot::shell
