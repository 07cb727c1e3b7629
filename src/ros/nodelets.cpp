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

// What waits for one another shares a lane: from a scan to lidar_driver's proposal, and from its points
// to preview_driver's. The arbiter decides whatever the others do, and pictures need not come at once.
constexpr LaneRule kScan{"scan", 0.0};
constexpr LaneRule kTunnel{"tunnel", 0.0};
constexpr LaneRule kArbiter{"arbiter", 0.0};
constexpr LaneRule kMarkers{"markers", 0.02};

using ScanFilterNodelet = StageNodelet<ScanFilterRos, kScan>;
using WallSegmentationNodelet = StageNodelet<WallSegmentationRos, kTunnel>;
using CenterlineNodelet = StageNodelet<CenterlineRos, kTunnel>;
using PreviewDriverNodelet = StageNodelet<PreviewDriverRos, kTunnel>;
using LidarDriverNodelet = StageNodelet<LidarDriverRos, kScan>;
using ArbiterNodelet = StageNodelet<ArbiterRos, kArbiter>;
using MarkersNodelet = StageNodelet<MarkersRos, kMarkers>;

}  // namespace tunnel_pilot::shell

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::ScanFilterNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::WallSegmentationNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::CenterlineNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::LidarDriverNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::PreviewDriverNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::ArbiterNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(tunnel_pilot::shell::MarkersNodelet, nodelet::Nodelet)
