// Fuzz target of the way from a scan to the tunnel's state (libFuzzer); scripts/fuzz builds and runs it.
// An input is a drive of a few scans: tunnels with wild places in them, ranges and geometries of any
// bits, clouds of any points.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "../../fuzz.h"
#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"

namespace tunnel_pilot::perception {
namespace {

constexpr int kMostScans = 8;
constexpr std::size_t kMostRawRanges = 256;
constexpr double kFieldOfView = 1.7;  // [rad] either side

config::Node shipped(const std::string& name) {
  return config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name + ".yaml");
}

struct Parameters {
  explicit Parameters(const std::string& variant)
      : filter(loadScanFilter(shipped("scan_filter"))),
        segmentation(loadWallSegmentation(shipped(variant + "wall_segmentation"))),
        centerline(loadCenterline(shipped(variant + "centerline"))) {}
  ScanFilterParameters filter;
  WallSegmentationParameters segmentation;
  CenterlineParameters centerline;
};

const Parameters& parameters(bool corridor) {
  static const Parameters truck("");
  static const Parameters person("corridor/");
  return corridor ? person : truck;
}

bool finite(const geometry::Point& p) { return std::isfinite(p.x()) && std::isfinite(p.y()); }

void checkFiltered(const ScanFilter::Result& result) {
  require(result.accepted == (result.rejection == ScanFilter::Rejection::kNone),
          "a rejection has a reason");
  const geometry::Scan& scan = result.network_scan;
  if (!result.accepted) {
    require(result.points->empty() && scan.ranges.empty(), "a rejected scan leaves nothing");
    return;
  }
  for (const pcl::PointXYZ& p : *result.points) {
    require(std::isfinite(p.x) && std::isfinite(p.y) && p.z == 0.0F, "points are finite");
  }
  require(scan.ranges.size() == ScanFilter::kNetworkBeams, "the network's scan has 761 beams");
  for (const float r : scan.ranges) {
    require(std::isnan(r) || r == std::numeric_limits<float>::infinity() || (r >= 0.0F && r <= 500.0F),
            "the network's ranges are returns, infinite or NaN");
  }
  for (const double share : result.valid_fraction) require(share >= 0.0 && share <= 1.0, "shares");
}

void checkWall(const Wall& wall, std::size_t points) {
  require(!wall.found || wall.curve.size() > 1, "a wall that was found has a curve");
  require(!wall.found || std::isfinite(wall.residual), "a wall's residual is finite");
  for (const geometry::Point& p : wall.curve) require(finite(p), "a wall's curve is finite");
  int last = -1;
  for (const int i : wall.indices) {
    require(i > last && static_cast<std::size_t>(i) < points,
            "a wall's points are the cloud's, in order");
    last = i;
  }
}

void checkTunnel(const Tunnel& tunnel, const CenterlineParameters& limits) {
  const TunnelState& state = tunnel.state;
  require(state.valid == (state.reason == TunnelReason::kNone),
          "a state that is not valid has a reason");
  require(state.valid != tunnel.centerline.empty(), "a valid state has a centerline, and no other");
  if (!state.valid) return;
  require(std::isfinite(state.lateral_offset) && std::isfinite(state.heading_error) &&
              std::isfinite(state.curvature),
          "a valid state is finite");
  require(state.width >= limits.width_min && state.width <= limits.width_max,
          "a valid width is in range");
  for (const double c : state.covariance) require(std::isfinite(c), "a covariance is finite");
  for (std::size_t i = 0; i < 16; i += 5)
    require(state.covariance[i] >= 0.0, "variances are not negative");
  for (const geometry::PathPoint& p : tunnel.centerline.points()) {
    require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.heading) &&
                std::isfinite(p.curvature),
            "a centerline is finite");
  }
}

/// One drive through the three stages.
class Drive {
 public:
  explicit Drive(FuzzBytes& bytes)
      : bytes_(bytes),
        parameters_(parameters(bytes.choice(4) == 0)),
        filter_(parameters_.filter),
        segmentation_(parameters_.segmentation),
        centerline_(parameters_.centerline) {
    const std::size_t beams[] = {191, 381, 761, 100};
    beams_ = beams[bytes.choice(4)];
    scan_.stamp = fromSeconds(10.0);
  }

  void step() {
    const auto how = bytes_.take<std::uint8_t>();
    moveOn(how & 3);
    switch (how >> 2 & 3) {
      case 0:
        anyGeometry();
        break;
      case 1:
        return segment(anyCloud());
      default:
        fitGeometry();
        tunnelRanges();
        break;
    }
    if ((how & 0x30) == 0x30 && !scan_.ranges.empty()) wildPlaces();
    if (how == 0xFF) reset();
    const ScanFilter::Result& result = filter_.filter(scan_, sensor_, now_);
    checkFiltered(result);
    segment(result.points);
  }

 private:
  void reset() {
    filter_.reset();
    segmentation_.reset();
    centerline_.reset();
  }

  // Stamps are what a ROS message can hold, [0, 2^32) s.
  void moveOn(int how) {
    const auto any = Stamp(static_cast<std::int64_t>(bytes_.take<std::uint32_t>()) * 1000000000);
    scan_.stamp = how == 0 ? any : scan_.stamp + std::chrono::milliseconds(29);
    now_ = scan_.stamp;
    switch (how) {
      case 0:
        pose_.reset();
        break;
      case 1:
        pose_ = geometry::Pose{bytes_.take<double>(), bytes_.take<double>(), bytes_.take<double>()};
        break;
      default:
        if (!pose_) pose_ = geometry::Pose{};
        pose_ = pose_->compose({bytes_.between(-0.5, 2.0), 0.0, bytes_.between(-0.2, 0.2)});
    }
  }

  void fitGeometry() {
    scan_.angle_min = -kFieldOfView;
    scan_.angle_increment = 2.0 * kFieldOfView / static_cast<double>(beams_ - 1);
    scan_.range_min = 0.05;
    scan_.range_max = 40.0;
    scan_.announced_angle_max = std::numeric_limits<double>::quiet_NaN();
    scan_.ranges.resize(beams_);
    sensor_ = {1.6, 0.0, 0.0};
  }

  void anyGeometry() {
    scan_.angle_min = bytes_.take<double>();
    scan_.angle_increment = bytes_.take<double>();
    scan_.time_increment = bytes_.take<double>();
    scan_.range_min = bytes_.take<double>();
    scan_.range_max = bytes_.take<double>();
    scan_.announced_angle_max = bytes_.take<double>();
    sensor_ = {bytes_.take<double>(), bytes_.take<double>(), bytes_.take<double>()};
    scan_.ranges.resize(bytes_.choice(kMostRawRanges));
    for (float& range : scan_.ranges) range = bytes_.take<float>();
  }

  // A straight tunnel, seen from within, with waves on its walls.
  void tunnelRanges() {
    const double width = bytes_.between(1.0, 12.0);
    const double offset = bytes_.between(-0.5, 0.5) * width;
    const double heading = bytes_.between(-1.6, 1.6);
    const double end = bytes_.between(0.0, 60.0);
    const double wave = bytes_.between(0.0, 1.0);
    const double wave_number = bytes_.between(0.0, 40.0);
    for (std::size_t i = 0; i < scan_.ranges.size(); ++i) {
      const double angle = scan_.angle(i) + heading;
      const double side = std::sin(angle) >= 0.0 ? 0.5 * width - offset : 0.5 * width + offset;
      double range = side / std::max(std::abs(std::sin(angle)), 1e-6);
      if (std::cos(angle) > 0.0) range = std::min(range, end / std::cos(angle));
      scan_.ranges[i] = static_cast<float>(range * (1.0 + wave * wave * std::sin(wave_number * angle)));
    }
  }

  void wildPlaces() {
    for (std::size_t places = bytes_.choice(6); places-- > 0;) {
      const std::size_t first = bytes_.take<std::uint16_t>() % scan_.ranges.size();
      const std::size_t end = std::min(first + bytes_.take<std::uint8_t>(), scan_.ranges.size());
      const std::size_t how = bytes_.choice(4);
      const auto value = bytes_.take<float>();
      for (std::size_t i = first; i < end; ++i) {
        float& range = scan_.ranges[i];
        if (how == 0) range = value;
        if (how == 1) range = std::numeric_limits<float>::infinity();
        if (how == 2) range *= value;
        if (how == 3) range = bytes_.take<float>();
      }
    }
  }

  pcl::PointCloud<pcl::PointXYZ>::ConstPtr anyCloud() {
    pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
    const bool raw = bytes_.choice(2) == 0;
    const double reach = bytes_.between(0.0, 60.0);
    for (std::size_t size = bytes_.take<std::uint8_t>(); size-- > 0;) {
      const float x = raw ? bytes_.take<float>() : static_cast<float>(bytes_.between(-reach, reach));
      const float y = raw ? bytes_.take<float>() : static_cast<float>(bytes_.between(-reach, reach));
      cloud->push_back({x, y, 0.0F});
    }
    cloud->is_dense = false;
    return cloud;
  }

  void segment(const pcl::PointCloud<pcl::PointXYZ>::ConstPtr& cloud) {
    segmentation_.setInputCloud(cloud);
    const Walls& walls = segmentation_.segment(scan_.stamp);
    checkWall(walls.left, cloud->size());
    checkWall(walls.right, cloud->size());
    checkTunnel(centerline_.update(walls, pose_), parameters_.centerline);
  }

  FuzzBytes& bytes_;
  std::size_t beams_ = 0;  // of scans with a geometry that fits
  const Parameters& parameters_;
  ScanFilter filter_;
  WallSegmentation segmentation_;
  CenterlineEstimator centerline_;
  geometry::Scan scan_;
  geometry::Pose sensor_{1.6, 0.0, 0.0};
  Stamp now_{};
  std::optional<geometry::Pose> pose_;
};

}  // namespace
}  // namespace tunnel_pilot::perception

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tunnel_pilot::FuzzBytes bytes(data, size);
  tunnel_pilot::perception::Drive drive(bytes);
  for (int i = 0; i < tunnel_pilot::perception::kMostScans && !bytes.empty(); ++i) drive.step();
  return 0;
}
