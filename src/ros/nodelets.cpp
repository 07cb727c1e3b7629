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

// From the scan to preview_driver's proposal each stage waits for the one before, and a scan waits until
// the last one is through, so that its tunnel never lags behind what lidar_driver answers beside it. The
// arbiter decides whatever the others do, and pictures need not come at once.
constexpr LaneRule kPerception{"perception", 0.0};
constexpr LaneRule kLidarDriver{"lidar_driver", 0.0};
constexpr LaneRule kArbiter{"arbiter", 0.0};
constexpr LaneRule kMarkers{"markers", 0.02};

using ScanFilterNodelet = StageNodelet<ScanFilterRos, kPerception>;
using WallSegmentationNodelet = StageNodelet<WallSegmentationRos, kPerception>;
using CenterlineNodelet = StageNodelet<CenterlineRos, kPerception>;
using PreviewDriverNodelet = StageNodelet<PreviewDriverRos, kPerception>;
using LidarDriverNodelet = StageNodelet<LidarDriverRos, kLidarDriver>;
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
