#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"

namespace tunnel_pilot::simulation {

/// The parameters of the perception's stages, each from its own file of a config folder.
struct PerceptionParameters {
  perception::ScanFilterParameters scan_filter;
  perception::WallSegmentationParameters wall_segmentation;
  perception::CenterlineParameters centerline;
};

/// The files that make up PerceptionParameters, in a folder.
std::vector<std::string> perceptionFiles(const std::string& config_folder);

/// Reads those three files, in the order of perceptionFiles(). Throws config::ConfigError.
PerceptionParameters loadPerception(const std::vector<std::string>& files);

/// Scan to tunnel: the three stages one after the other, as their nodelets do it.
class PerceptionChain {
 public:
  explicit PerceptionChain(const PerceptionParameters& parameters);

  /// The tunnel of this scan, or nullptr when the scan was rejected (filtered() tells why). `odom_pose`
  /// is base_link in odom at the scan's stamp, where it is known. The result stands until the next call.
  const perception::Tunnel* update(const geometry::Scan& scan, const geometry::Pose& sensor_in_base,
                                   const std::optional<geometry::Pose>& odom_pose, Stamp now);

  /// Results of the last update.
  const perception::ScanFilter::Result& filtered() const { return *filtered_; }
  const perception::Walls& walls() const { return *walls_; }

 private:
  perception::ScanFilter filter_;
  perception::WallSegmentation segmentation_;
  perception::CenterlineEstimator centerline_;
  const perception::ScanFilter::Result* filtered_ = nullptr;
  const perception::Walls* walls_ = nullptr;
};

}  // namespace tunnel_pilot::simulation
