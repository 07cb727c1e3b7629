#include "drive.h"

#include <cmath>
#include <limits>

namespace tunnel_pilot::perception {
namespace {

constexpr double kDegree = 0.017453292519943295;
const world::RayCaster::Beams kBeams{-95.0 * kDegree, 0.25 * kDegree, 761, 40.0};

std::string config(const std::string& variant, const std::string& stage) {
  return shippedFile("config/" + (variant.empty() ? "" : variant + "/") + stage + ".yaml");
}

}  // namespace

std::string shippedFile(const std::string& name) {
  return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/" + name;
}

TestLidar::TestLidar(const std::vector<world::WallChain>& walls, std::uint64_t seed)
    : caster_(walls, kBeams), random_(seed) {
  scan_.stamp = fromSeconds(10.0);
  scan_.angle_min = kBeams.angle_min;
  scan_.angle_increment = kBeams.angle_increment;
  scan_.range_min = 0.05;
  scan_.range_max = kBeams.range_max;
}

const geometry::Scan& TestLidar::scan(const geometry::Pose& base) {
  std::normal_distribution<float> noise(0.0F, 0.012F);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  scan_.stamp += fromSeconds(1.0 / 35.0);
  caster_.cast(base.compose(kLidar), scan_.ranges);
  for (float& range : scan_.ranges) {
    range += noise(random_);
    if (share(random_) < lost) range = std::numeric_limits<float>::infinity();
  }
  return scan_;
}

TestChain::TestChain(const std::string& variant)
    : filter(loadScanFilter(config::loadFile(config("", "scan_filter")))),
      segmentation(loadWallSegmentation(config::loadFile(config(variant, "wall_segmentation")))),
      centerline(loadCenterline(config::loadFile(config(variant, "centerline")))) {}

const Tunnel& TestChain::update(const geometry::Scan& scan,
                                const std::optional<geometry::Pose>& odom_pose,
                                const geometry::Pose& lidar) {
  filtered = &filter.filter(scan, lidar, scan.stamp);
  segmentation.setInputCloud(filtered->points);
  walls = &segmentation.segment(scan.stamp);
  return centerline.update(*walls, odom_pose);
}

std::vector<world::WallChain> smoothWalls(const geometry::Path& line, double width) {
  std::vector<world::WallChain> walls(2);
  for (const geometry::PathPoint& p : line.points()) {
    const geometry::Point place(p.x, p.y);
    const geometry::Point left(-std::sin(p.heading), std::cos(p.heading));
    walls[0].push_back(place + 0.5 * width * left);
    walls[1].push_back(place - 0.5 * width * left);
  }
  return walls;
}

world::WallChain box(const geometry::Pose& middle, double length, double width) {
  world::WallChain chain;
  for (const auto& [x, y] : {std::pair{0.5, 0.5}, {-0.5, 0.5}, {-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}}) {
    chain.push_back(middle.transform({x * length, y * width}));
  }
  return chain;
}

}  // namespace tunnel_pilot::perception
