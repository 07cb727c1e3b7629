#include "tunnel_pilot/simulation/perception_chain.h"

namespace tunnel_pilot::simulation {

std::vector<std::string> perceptionFiles(const std::string& config_folder) {
  return {config_folder + "/scan_filter.yaml", config_folder + "/wall_segmentation.yaml",
          config_folder + "/centerline.yaml"};
}

PerceptionParameters loadPerception(const std::vector<std::string>& files) {
  return {perception::loadScanFilter(config::loadFile(files.at(0))),
          perception::loadWallSegmentation(config::loadFile(files.at(1))),
          perception::loadCenterline(config::loadFile(files.at(2)))};
}

PerceptionChain::PerceptionChain(const PerceptionParameters& parameters)
    : filter_(parameters.scan_filter),
      segmentation_(parameters.wall_segmentation),
      centerline_(parameters.centerline) {}

const perception::Tunnel* PerceptionChain::update(const geometry::Scan& scan,
                                                  const geometry::Pose& sensor_in_base,
                                                  const std::optional<geometry::Pose>& odom_pose,
                                                  Stamp now) {
  filtered_ = &filter_.filter(scan, sensor_in_base, now);
  if (!filtered_->accepted) return nullptr;
  segmentation_.setInputCloud(filtered_->points);
  walls_ = &segmentation_.segment(scan.stamp);
  return &centerline_.update(*walls_, odom_pose);
}

}  // namespace tunnel_pilot::simulation
