#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/PointCloud2.h>

#include "tunnel_pilot/perception/wall_segmentation.h"
#include "tunnel_pilot/ros/diagnostics.h"

namespace tunnel_pilot::shell {

/// Shell of perception::WallSegmentation. Subscribes `points` (sensor_msgs/PointCloud2 in base_link),
/// publishes `walls` (tunnel_pilot/Walls) with the cloud's stamp for every cloud, found or not. A cloud
/// in another frame or without x, y, z is refused, logged, counted and told on /diagnostics. Parameters:
/// config/wall_segmentation.yaml. Throws config::ConfigError.
class WallSegmentationRos {
 public:
  WallSegmentationRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void onPoints(const sensor_msgs::PointCloud2& message);
  void fillStatus(Diagnostics::Status& status) const;

  perception::WallSegmentation segmentation_;
  unsigned long clouds_ = 0;
  unsigned long refused_ = 0;
  bool last_refused_ = false;
  bool left_ = false;
  bool right_ = false;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
  Diagnostics diagnostics_;
};

}  // namespace tunnel_pilot::shell
