#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/ScanRejection.h>

#include <string>

#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/diagnostics.h"
#include "tunnel_pilot/ros/parameters.h"
#include "tunnel_pilot/ros/publisher_watch.h"
#include "tunnel_pilot/ros/sensor_pose.h"

namespace tunnel_pilot::shell {

/// Shell of perception::ScanFilter. Subscribes `scan` (any planar lidar that covers +-90 degrees), needs
/// TF base_link -> the scan's frame once. Publishes `scan_filtered` (sensor_msgs/LaserScan, the
/// network's 761 beams, frame of the scan) and `points` (sensor_msgs/PointCloud2 in base_link), both
/// with the scan's stamp; for a rejected scan `scan_rejected` (tunnel_pilot/ScanRejection) instead, and
/// it is logged, counted and told on /diagnostics. While more than one node publishes `scan`, every scan
/// is rejected. Parameters:
/// config/scan_filter.yaml, and `publisher`, the only node that may publish `scan` (absent: any one
/// node). Throws config::ConfigError.
class ScanFilterRos {
 public:
  ScanFilterRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  ScanFilterRos(ros::NodeHandle nh, const ros::NodeHandle& private_nh, Parameters parameters);

  using ScanEvent = ros::MessageEvent<const sensor_msgs::LaserScan>;
  void onScan(const ScanEvent& event);
  void reject(const sensor_msgs::LaserScan& scan, const std::string& why, bool frozen = false);
  void publish(const perception::ScanFilter::Result& result, const sensor_msgs::LaserScan& source);
  void fillStatus(Diagnostics::Status& status) const;

  PublisherWatch publishers_;
  perception::ScanFilter filter_;
  SensorPose sensor_pose_;
  ClockWatch clock_;
  std::string problem_ = "no scan yet";  // why the last scan was not used; empty when it was
  std::uint64_t foreign_ = 0;            // scans rejected for who published them
  ros::Publisher scan_publisher_;
  ros::Publisher points_publisher_;
  ros::Publisher rejection_publisher_;
  ros::Subscriber scan_subscriber_;
  Diagnostics diagnostics_;
};

}  // namespace tunnel_pilot::shell
