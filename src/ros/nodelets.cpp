#include <pluginlib/class_list_macros.hpp>

#include "tunnel_pilot/ros/arbiter_ros.h"
#include "tunnel_pilot/ros/centerline_ros.h"
#include "tunnel_pilot/ros/lidar_driver_ros.h"
#include "tunnel_pilot/ros/markers_ros.h"
#include "tunnel_pilot/ros/preview_driver_ros.h"
#include "tunnel_pilot/ros/scan_filter_ros.h"
#include "tunnel_pilot/ros/stage.h"
#include "tunnel_pilot/ros/wall_segmentation_ros.h"

namespace tunnel_pilot::shell {

// On the way to the command: decisions before all else. The network, which needs the points alone,
// before the tunnel, which takes three times as long; then whoever is nearer to the command, so that a
// scan is through before the next. Pictures stand aside: no hanging picture shall hold up a command.
constexpr char kPilot[] = "pilot";
constexpr char kPictures[] = "pictures";

using ArbiterNodelet = StageNodelet<ArbiterRos, kPilot, 0>;
using LidarDriverNodelet = StageNodelet<LidarDriverRos, kPilot, 1>;
using PreviewDriverNodelet = StageNodelet<PreviewDriverRos, kPilot, 2>;
using CenterlineNodelet = StageNodelet<CenterlineRos, kPilot, 3>;
using WallSegmentationNodelet = StageNodelet<WallSegmentationRos, kPilot, 4>;
using ScanFilterNodelet = StageNodelet<ScanFilterRos, kPilot, 5>;
using MarkersNodelet = StageNodelet<MarkersRos, kPictures, 0>;

}  // namespace tunnel_pilot::shell

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::ScanFilterNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::WallSegmentationNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::CenterlineNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::LidarDriverNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::PreviewDriverNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::ArbiterNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::MarkersNodelet, nodelet::Nodelet)
