// From a scan to the tunnel's heading: our scan filter, walls and centerline, beside PCL's usual chain
// (voxel grid, statistical outlier removal, two RANSAC lines, Euclidean clusters) and OpenCV's lines.
// The drift has bends of 12 to 16 m radius and rough walls; every method is asked for the tunnel's
// direction beside the front axle, and its error there is told beside its time.

#include <pcl/search/kdtree.h>
#include <pcl/segmentation/extract_clusters.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "harness.h"
#include "pcl_chain.h"
#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"
#include "tunnel_pilot/world/ray_caster.h"

namespace {

using namespace tunnel_pilot;
using benchmark::Cloud;
using benchmark::PclSettings;
using geometry::Point;
using geometry::Pose;

constexpr int kBeams = 761;
constexpr double kDegree = M_PI / 180.0;
constexpr double kHalfWidth = 2.5;  // [m]
constexpr double kStep = 0.09;      // [m] between scans: 35 Hz at 3 m/s
const Pose kLidar{1.6, 0.0, 0.0};

// A scan with the truth it was taken at.
struct Sample {
  geometry::Scan scan;
  Pose pose;               // of the front axle in the map
  double heading = 0.0;    // truck heading minus tunnel direction [rad]
  double curvature = 0.0;  // of the tunnel [1/m]
};

// Walls beside a line, with a deviation of 0.05 m correlated over about 2 m.
world::WallChain roughWall(const geometry::Path& line, double side, std::mt19937_64& random) {
  std::normal_distribution<double> draw(0.0, 1.0);
  std::vector<double> noise(line.points().size());
  for (double& n : noise) n = draw(random);
  world::WallChain wall;
  for (std::size_t i = 0; i < noise.size(); ++i) {
    double sum = 0.0;
    double energy = 0.0;
    for (int k = -8; k <= 8; ++k) {
      const double weight = std::exp(-2.0 * (0.25 * k) * (0.25 * k));  // 0.5 m samples
      const auto j = std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(i) + k, 0,
                                                static_cast<std::ptrdiff_t>(noise.size()) - 1);
      sum += weight * noise[static_cast<std::size_t>(j)];
      energy += weight * weight;
    }
    const geometry::PathPoint& p = line.points()[i];
    const double offset = side * (kHalfWidth + 0.05 * sum / std::sqrt(energy));
    wall.emplace_back(p.x - offset * std::sin(p.heading), p.y + offset * std::cos(p.heading));
  }
  return wall;
}

std::vector<Sample> drive() {
  std::mt19937_64 random(3);
  const double k12 = 1.0 / 12.0;
  const double k16 = 1.0 / 16.0;
  const geometry::Path line = geometry::buildPath({{30.0, 0.0, 0.0},
                                                   {8.0, 0.0, k12},
                                                   {12.0, k12, k12},
                                                   {8.0, k12, 0.0},
                                                   {20.0, 0.0, 0.0},
                                                   {10.0, 0.0, -k16},
                                                   {16.0, -k16, -k16},
                                                   {10.0, -k16, 0.0},
                                                   {60.0, 0.0, 0.0}},
                                                  {}, 0.5);
  const std::vector<world::WallChain> walls = {roughWall(line, 1.0, random),
                                               roughWall(line, -1.0, random)};
  const world::RayCaster caster(walls, {-95.0 * kDegree, 0.25 * kDegree, kBeams, 40.0});
  std::normal_distribution<float> noise(0.0F, 0.012F);
  std::vector<Sample> samples;
  for (double s = 10.0; s < 130.0; s += kStep) {
    const geometry::PathPoint at = line.at(s);
    Sample sample;
    sample.heading = 0.05 * std::sin(s / 6.0);
    sample.curvature = at.curvature;
    sample.pose = {at.x, at.y, at.heading + sample.heading};
    sample.scan.stamp = fromSeconds(s / 3.0);
    sample.scan.angle_min = -95.0 * kDegree;
    sample.scan.angle_increment = 0.25 * kDegree;
    sample.scan.range_min = 0.05;
    sample.scan.range_max = 40.0;
    caster.cast(sample.pose.compose(kLidar), sample.scan.ranges);
    for (float& range : sample.scan.ranges) {
      range += noise(random);
      if (random() % 50 == 0) range = std::numeric_limits<float>::infinity();
    }
    samples.push_back(std::move(sample));
  }
  return samples;
}

// --- ours
// ----------------------------------------------------------------------------------------------------

class Ours {
 public:
  Ours()
      : filter_(perception::loadScanFilter(config::loadFile(file("scan_filter")))),
        segmentation_(perception::loadWallSegmentation(config::loadFile(file("wall_segmentation")))),
        centerline_(perception::loadCenterline(config::loadFile(file("centerline")))) {}

  double heading(const Sample& sample) {
    if (sample.scan.stamp < last_) reset();
    last_ = sample.scan.stamp;
    const perception::ScanFilter::Result& filtered =
        filter_.filter(sample.scan, kLidar, sample.scan.stamp);
    segmentation_.setInputCloud(filtered.points);
    const perception::Walls& walls = segmentation_.segment(sample.scan.stamp);
    const perception::TunnelState& state = centerline_.update(walls, sample.pose).state;
    return state.valid ? state.heading_error : std::nan("");
  }

 private:
  static std::string file(const std::string& stage) {
    return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + stage + ".yaml";
  }
  void reset() {
    filter_.reset();
    segmentation_.reset();
    centerline_.reset();
  }

  perception::ScanFilter filter_;
  perception::WallSegmentation segmentation_;
  perception::CenterlineEstimator centerline_;
  Stamp last_{};
};

// --- peers
// ---------------------------------------------------------------------------------------------------

Cloud::Ptr cloudOf(const geometry::Scan& scan) {
  Cloud::Ptr cloud(new Cloud);
  cloud->reserve(scan.ranges.size());
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const float range = scan.ranges[i];
    if (!(range >= scan.range_min && range <= scan.range_max)) continue;
    const double angle = scan.angle(i);
    cloud->push_back({static_cast<float>(kLidar.x + range * std::cos(angle)),
                      static_cast<float>(range * std::sin(angle)), 0.0F});
  }
  return cloud;
}

// Direction of a line, taken ahead [rad].
double ahead(double x, double y) { return x < 0.0 ? std::atan2(-y, -x) : std::atan2(y, x); }

// Voxel grid, statistical outlier removal, two lines by RANSAC, clusters of what is left.
double pclChain(const Sample& sample, const PclSettings& settings) {
  Cloud::Ptr rest =
      benchmark::withoutOutliers(benchmark::thinned(cloudOf(sample.scan), settings), settings);
  double heading = 0.0;
  for (int wall = 0; wall < 2; ++wall) {
    const auto line = benchmark::takeLine(rest);
    if (!line) return std::nan("");
    heading += 0.5 * ahead(line->values[3], line->values[4]);
  }
  pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>);
  if (!rest->empty()) {
    tree->setInputCloud(rest);
    pcl::EuclideanClusterExtraction<pcl::PointXYZ> clusters;
    clusters.setClusterTolerance(0.5);
    clusters.setMinClusterSize(5);
    clusters.setSearchMethod(tree);
    clusters.setInputCloud(rest);
    std::vector<pcl::PointIndices> found;
    clusters.extract(found);
  }
  return -heading;
}

// OpenCV's Hough lines in a picture of 0.1 m a pixel: the two longest of different sides.
double houghLines(const Sample& sample) {
  constexpr int kSize = 300;
  constexpr double kPixel = 0.1;
  cv::Mat picture = cv::Mat::zeros(kSize, kSize, CV_8U);
  const Cloud::Ptr cloud = cloudOf(sample.scan);
  for (const pcl::PointXYZ& p : cloud->points) {
    const int column = static_cast<int>(p.x / kPixel);
    const int row = static_cast<int>(p.y / kPixel) + kSize / 2;
    if (column >= 0 && column < kSize && row >= 0 && row < kSize)
      picture.at<unsigned char>(row, column) = 255;
  }
  std::vector<cv::Vec4i> lines;
  cv::HoughLinesP(picture, lines, 1.0, CV_PI / 180.0, 20, 20.0, 10.0);
  double best[2] = {0.0, 0.0};
  double heading[2] = {0.0, 0.0};
  for (const cv::Vec4i& l : lines) {
    const double dx = l[2] - l[0];
    const double dy = l[3] - l[1];
    const int side = l[1] + l[3] > kSize ? 0 : 1;
    const double length = std::hypot(dx, dy);
    if (length <= best[side]) continue;
    best[side] = length;
    heading[side] = ahead(dx, dy);
  }
  if (best[0] == 0.0 || best[1] == 0.0) return std::nan("");
  return -0.5 * (heading[0] + heading[1]);
}

// OpenCV's robust line through the near returns of either side.
double fitLines(const Sample& sample) {
  const Cloud::Ptr cloud = cloudOf(sample.scan);
  std::vector<cv::Point2f> sides[2];
  for (const pcl::PointXYZ& p : cloud->points) {
    if (std::abs(p.y) < 4.0F && p.x < 10.0F) sides[p.y > 0.0F ? 0 : 1].emplace_back(p.x, p.y);
  }
  double heading = 0.0;
  for (const std::vector<cv::Point2f>& side : sides) {
    if (side.size() < 2) return std::nan("");
    cv::Vec4f line;
    cv::fitLine(side, line, cv::DIST_HUBER, 0.0, 0.01, 0.01);
    heading += 0.5 * ahead(line[0], line[1]);
  }
  return -heading;
}

// --- errors
// --------------------------------------------------------------------------------------------------

struct Error {
  double median = 0.0;  // [degree]
  double p95 = 0.0;
};

// Heading errors in bends, over the whole drive; a missing answer counts as 90 degrees.
Error errorInBends(const std::vector<Sample>& samples,
                   const std::function<double(const Sample&)>& method) {
  std::vector<double> errors;
  for (const Sample& sample : samples) {
    const double heading = method(sample);
    if (std::abs(sample.curvature) < 1.0 / 16.5) continue;
    const double error = geometry::wrapAngle(heading - sample.heading) / kDegree;
    errors.push_back(std::isfinite(error) ? std::abs(error) : 90.0);
  }
  std::sort(errors.begin(), errors.end());
  return {errors[errors.size() / 2], errors[errors.size() * 95 / 100]};
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<Sample> samples = drive();
  Ours ours;
  const std::vector<std::pair<std::string, std::function<double(const Sample&)>>> methods = {
      {"ours", [&](const Sample& s) { return ours.heading(s); }},
      {"PCL chain", [](const Sample& s) { return pclChain(s, benchmark::kTutorial); }},
      {"PCL chain, light settings", [](const Sample& s) { return pclChain(s, benchmark::kLight); }},
      {"OpenCV HoughLinesP", houghLines},
      {"OpenCV fitLine (Huber)", fitLines}};
  benchmark::Contest contest("scan to tunnel heading", argc, argv);
  volatile double sink = 0.0;
  std::vector<std::size_t> next(methods.size(), 0);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    contest.add(methods[m].first, [&, m] {
      sink = methods[m].second(samples[next[m]]);
      next[m] = (next[m] + 1) % samples.size();
    });
  }
  if (!contest.run()) return 0;
  contest.requireAtMost("time of a scan", "us", contest.median("ours"), 25.0);
  contest.requireFaster("PCL chain", "ours", 30.0);
  contest.tell("PCL chain, light settings", "ours");
  contest.tell("OpenCV HoughLinesP", "ours");
  contest.tell("OpenCV fitLine (Huber)", "ours");
  for (const auto& [name, method] : methods) {
    const Error error = errorInBends(samples, method);
    std::printf("heading error in bends of 12-16 m radius: %s %.2f degrees median, %.2f p95\n",
                name.c_str(), error.median, error.p95);
    if (name != "ours") continue;
    contest.requireAtMost("heading error in bends, median", "degree", error.median, 2.0);
    contest.requireAtMost("heading error in bends, p95", "degree", error.p95, 5.5);
  }
  return contest.finish();
}
