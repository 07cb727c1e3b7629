#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"
#include "tunnel_pilot/world/ray_caster.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::perception {

inline const geometry::Pose kLidar{1.6, 0.0, 0.0};  // in base_link [m]

/// Scans of the truck's lidar from exact ranges, with noise of 12 mm and a share of lost beams.
class TestLidar {
 public:
  explicit TestLidar(const std::vector<world::WallChain>& walls, std::uint64_t seed = 1);

  double lost = 0.02;  ///< share of beams without a return [1]

  /// The next scan, 1/35 s after the last.
  const geometry::Scan& scan(const geometry::Pose& base);
  world::RayCaster& caster() { return caster_; }

 private:
  world::RayCaster caster_;
  std::mt19937_64 random_;
  geometry::Scan scan_;
};

/// The perception's three stages with the shipped parameters.
class TestChain {
 public:
  /// `variant` is a folder below config/, empty for the truck's own.
  explicit TestChain(const std::string& variant = "");
  const Tunnel& update(const geometry::Scan& scan, const std::optional<geometry::Pose>& odom_pose,
                       const geometry::Pose& lidar = kLidar);

  ScanFilter filter;
  WallSegmentation segmentation;
  CenterlineEstimator centerline;
  const Walls* walls = nullptr;
  const ScanFilter::Result* filtered = nullptr;
};

/// Two walls `width` apart along a design line [m], smooth, in the map frame.
std::vector<world::WallChain> smoothWalls(const geometry::Path& line, double width);

/// Closed outline of a box [m]: its middle and heading, length along and width across it.
world::WallChain box(const geometry::Pose& middle, double length, double width);

std::string shippedFile(const std::string& name);

}  // namespace tunnel_pilot::perception
