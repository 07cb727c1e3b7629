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

using ScanFilterNodelet = StageNodelet<ScanFilterRos>;
using WallSegmentationNodelet = StageNodelet<WallSegmentationRos>;
using CenterlineNodelet = StageNodelet<CenterlineRos>;
using LidarDriverNodelet = StageNodelet<LidarDriverRos>;
using PreviewDriverNodelet = StageNodelet<PreviewDriverRos>;
using ArbiterNodelet = StageNodelet<ArbiterRos>;
using MarkersNodelet = StageNodelet<MarkersRos>;

}  // namespace tunnel_pilot::shell

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::ScanFilterNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::WallSegmentationNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::CenterlineNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::LidarDriverNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::PreviewDriverNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::ArbiterNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::MarkersNodelet, nodelet::Nodelet)
