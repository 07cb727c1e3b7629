#include "tunnel_pilot/perception/wall_segmentation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "corridor_seed.h"
#include "corridor_smoother.h"
#include "point_grid.h"

namespace tunnel_pilot::perception {
namespace {

constexpr double kCurveSpacing = 0.5;  // [m] of the fitted curves' samples
constexpr std::array<double, 2> kSides = {1.0, -1.0};

// Which node a group lies beside, and how far off the expected wall, for each group that was taken.
struct Taken {
  int group;
  int node;
};

double square(double x) { return x * x; }

}  // namespace

WallSegmentationParameters loadWallSegmentation(config::Node node) {
  WallSegmentationParameters p;
  p.width_min = node.number("width_min", "m", 0.5, 20.0);
  p.width_max = node.number("width_max", "m", 0.5, 20.0);
  if (p.width_max <= p.width_min) node.refuse("width_max", "must exceed width_min");
  p.lookahead = node.number("lookahead", "m", 2.0, 40.0);
  p.look_behind = node.number("look_behind", "m", 0.0, 5.0);
  p.step = node.number("step", "m", 0.2, 2.0);
  p.spacing = node.number("spacing", "m", 0.01, 1.0);
  p.seed_radius = node.number("seed_radius", "m", 1.0, 20.0);
  p.seed_heading_max = node.number("seed_heading_max", "rad", 0.1, 1.5);
  p.seed_curvature_max = node.number("seed_curvature_max", "1/m", 0.0, 1.0);
  p.wall_deviation = node.number("wall_deviation", "m", 0.001, 1.0);
  p.curvature_walk = node.number("curvature_walk", "1/m per sqrt(m)", 1e-5, 1.0);
  p.width_walk = node.number("width_walk", "m per sqrt(m)", 1e-5, 1.0);
  p.gate_min = node.number("gate_min", "m", 0.01, 2.0);
  p.gate_max = node.number("gate_max", "m", 0.01, 2.0);
  if (p.gate_max < p.gate_min) node.refuse("gate_max", "must not be below gate_min");
  p.gap_max = node.number("gap_max", "m", 0.5, 20.0);
  p.wall_length_min = node.number("wall_length_min", "m", 0.5, 20.0);
  p.wall_coverage_min = node.number("wall_coverage_min", "1", 0.0, 1.0);
  p.inlier_distance = node.number("inlier_distance", "m", 0.01, 1.0);
  p.points_min = static_cast<int>(node.integer("points_min", "1", 2, 1000));
  node.finish();
  return p;
}

struct WallSegmentation::Impl {
  explicit Impl(const WallSegmentationParameters& parameters)
      : p(parameters),
        seeder(p),
        smoother(square(p.curvature_walk), square(p.width_walk)) {}

  const WallSegmentationParameters p;
  CorridorSeeder seeder;
  CorridorSmoother smoother;
  PointGrid grid;
  std::vector<PointGroup> groups;
  std::vector<int> order;                            // finite points of the input, as indices
  std::array<std::vector<Taken>, 2> taken;           // by side
  std::array<std::vector<unsigned char>, 2> seen;    // by side and node: the wall was measured there

  void group(const pcl::PointCloud<pcl::PointXYZ>& cloud, const std::vector<int>& indices);
  void start(const CorridorSeed& seed);
  void follow(const CorridorSeed& seed);
  bool measure(int side);
  std::size_t firstSeen() const;
  void finish(const pcl::PointCloud<pcl::PointXYZ>& cloud, int side, std::size_t first, Wall& wall);
  void collectInliers(const pcl::PointCloud<pcl::PointXYZ>& cloud, int side, Wall& wall);
  bool isWall(int side) const;
  void drawCurve(int side, std::size_t first, std::size_t last, Wall& wall) const;
};

WallSegmentation::WallSegmentation(const WallSegmentationParameters& parameters)
    : impl_(new Impl(parameters)), parameters_(parameters) {}

WallSegmentation::~WallSegmentation() = default;

const Walls& WallSegmentation::segment(Stamp stamp) {
  walls_.stamp = stamp;
  walls_.enough_returns = false;
  for (Wall* wall : {&walls_.left, &walls_.right}) {
    wall->found = false;
    wall->residual = 0.0;
    wall->indices.clear();
    wall->curve.clear();
  }
  if (!initCompute()) return walls_;
  impl_->group(*input_, *indices_);
  walls_.enough_returns = static_cast<int>(impl_->order.size()) >= parameters_.points_min;
  if (walls_.enough_returns) {
    if (const std::optional<CorridorSeed> seed = impl_->seeder.find(impl_->groups)) {
      impl_->follow(*seed);
      const std::size_t first = impl_->firstSeen();
      impl_->finish(*input_, 0, first, walls_.left);
      impl_->finish(*input_, 1, first, walls_.right);
    }
  }
  deinitCompute();
  return walls_;
}

void WallSegmentation::Impl::group(const pcl::PointCloud<pcl::PointXYZ>& cloud,
                                   const std::vector<int>& indices) {
  const auto reach_squared = static_cast<float>(square(p.spacing));
  groups.clear();
  order.clear();
  float x0 = 0.0F;
  float y0 = 0.0F;
  PointGroup sum;
  const auto close = [&] {
    const auto count = static_cast<float>(sum.last - sum.first);
    if (sum.last > sum.first) groups.push_back({sum.x / count, sum.y / count, sum.first, sum.last});
  };
  for (const int index : indices) {
    const pcl::PointXYZ& point = cloud.points[static_cast<std::size_t>(index)];
    if (!std::isfinite(point.x) || !std::isfinite(point.y)) continue;
    const int at = static_cast<int>(order.size());
    order.push_back(index);
    const float dx = point.x - x0;
    const float dy = point.y - y0;
    if (at == sum.first || dx * dx + dy * dy > reach_squared) {
      close();
      sum = {0.0F, 0.0F, at, at};
      x0 = point.x;
      y0 = point.y;
    }
    sum.x += point.x;
    sum.y += point.y;
    sum.last = at + 1;
  }
  close();
}

void WallSegmentation::Impl::start(const CorridorSeed& seed) {
  const double nominal = 0.5 * (p.width_min + p.width_max);
  const double left = seed.left ? *seed.left : *seed.right + nominal;
  const double right = seed.right ? *seed.right : *seed.left - nominal;
  const double middle = 0.5 * (left + right);
  CorridorNode node;
  node.curvature = seed.curvature / (1.0 - middle * seed.curvature);
  node.half_width = 0.5 * (left - right);
  // Back along the arc to where the curves shall begin.
  node.pose = {-middle * std::sin(seed.heading), middle * std::cos(seed.heading), seed.heading};
  const double back = p.look_behind;
  const double mean_heading = seed.heading - 0.5 * back * node.curvature;
  node.pose.x -= back * std::cos(mean_heading);
  node.pose.y -= back * std::sin(mean_heading);
  node.pose.heading -= back * node.curvature;
  const bool paired = seed.left && seed.right;
  smoother.start(node, {0.3, 0.15, 0.05, paired ? 0.3 : 1e-3});
}

void WallSegmentation::Impl::follow(const CorridorSeed& seed) {
  grid.fill(groups);
  start(seed);
  for (std::size_t side = 0; side < 2; ++side) {
    taken[side].clear();
    seen[side].clear();
  }
  const std::array<bool, 2> followed = {seed.left.has_value(), seed.right.has_value()};
  const auto steps = static_cast<int>((p.lookahead + p.look_behind) / p.step);
  double unseen = 0.0;
  for (int k = 0; k <= steps; ++k) {
    if (k > 0) smoother.advance(p.step);
    bool any = false;
    for (int side = 0; side < 2; ++side) {
      const bool measured = followed[static_cast<std::size_t>(side)] && measure(side);
      seen[static_cast<std::size_t>(side)].push_back(static_cast<unsigned char>(measured));
      any = any || measured;
    }
    unseen = any ? 0.0 : unseen + p.step;
    if (unseen > p.gap_max) break;
  }
  smoother.smooth();
}

bool WallSegmentation::Impl::measure(int side) {
  const double sign = kSides[static_cast<std::size_t>(side)];
  const CorridorNode node = smoother.last();
  const double deviation = std::sqrt(smoother.expectedVariance(sign) + square(p.wall_deviation));
  const double gate = std::clamp(3.0 * deviation, p.gate_min, p.gate_max);
  const double middle = sign * node.half_width;
  CorridorSmoother::Slice slice;
  int count = 0;
  std::vector<Taken>& mine = taken[static_cast<std::size_t>(side)];
  const int at = static_cast<int>(smoother.size()) - 1;
  grid.visitSlice(groups, node.pose, 0.5 * p.step, middle - gate, middle + gate,
                  [&](int group, float along, float lateral) {
                    slice.along += along;
                    slice.along_squared += along * along;
                    slice.lateral += lateral;
                    ++count;
                    mine.push_back({group, at});
                  });
  if (count == 0) return false;
  slice.along /= count;
  slice.along_squared /= count;
  slice.lateral /= count;
  smoother.measure(sign, slice, square(p.wall_deviation));
  return true;
}

bool WallSegmentation::Impl::isWall(int side) const {
  const std::vector<unsigned char>& slices = seen[static_cast<std::size_t>(side)];
  const auto count = std::count(slices.begin(), slices.end(), 1);
  if (count * p.step < p.wall_length_min) return false;
  const auto first = std::find(slices.begin(), slices.end(), 1);
  const auto last = std::find(slices.rbegin(), slices.rend(), 1).base();
  return count >= p.wall_coverage_min * static_cast<double>(std::distance(first, last));
}

// The first slice in which a wall was measured: both curves begin there, so that their samples pair up.
std::size_t WallSegmentation::Impl::firstSeen() const {
  std::size_t first = smoother.size();
  for (int side = 0; side < 2; ++side) {
    if (!isWall(side)) continue;
    const std::vector<unsigned char>& slices = seen[static_cast<std::size_t>(side)];
    const auto at = std::distance(slices.begin(), std::find(slices.begin(), slices.end(), 1));
    first = std::min(first, static_cast<std::size_t>(at));
  }
  return first;
}

void WallSegmentation::Impl::finish(const pcl::PointCloud<pcl::PointXYZ>& cloud, int side,
                                    std::size_t first, Wall& wall) {
  if (!isWall(side)) return;
  wall.found = true;
  const std::vector<unsigned char>& slices = seen[static_cast<std::size_t>(side)];
  const auto last = std::find(slices.rbegin(), slices.rend(), 1).base();
  drawCurve(side, first, static_cast<std::size_t>(std::distance(slices.begin(), last)) - 1, wall);
  collectInliers(cloud, side, wall);
}

void WallSegmentation::Impl::drawCurve(int side, std::size_t first, std::size_t last, Wall& wall) const {
  const int pieces = std::max(1, static_cast<int>(std::lround(p.step / kCurveSpacing)));
  for (std::size_t i = first; i <= last; ++i) {
    const CorridorNode& a = smoother.node(i);
    const int count = i < last ? pieces : 1;
    for (int j = 0; j < count; ++j) {
      const double t = static_cast<double>(j) / pieces;
      CorridorNode n = a;
      if (j > 0) {
        // Cubic Hermite between the nodes.
        const CorridorNode& b = smoother.node(i + 1);
        const double l = p.step;
        const double h1 = t * t * (3.0 - 2.0 * t);
        const double m0 = l * t * square(1.0 - t);
        const double m1 = l * t * t * (t - 1.0);
        n.pose.x = a.pose.x + h1 * (b.pose.x - a.pose.x) + m0 * std::cos(a.pose.heading) + m1 * std::cos(b.pose.heading);
        n.pose.y = a.pose.y + h1 * (b.pose.y - a.pose.y) + m0 * std::sin(a.pose.heading) + m1 * std::sin(b.pose.heading);
        n.pose.heading = a.pose.heading + t * (b.pose.heading - a.pose.heading);
        n.half_width = a.half_width + t * (b.half_width - a.half_width);
      }
      const double offset = kSides[static_cast<std::size_t>(side)] * n.half_width;
      wall.curve.emplace_back(n.pose.x - offset * std::sin(n.pose.heading),
                              n.pose.y + offset * std::cos(n.pose.heading));
    }
  }
}

void WallSegmentation::Impl::collectInliers(const pcl::PointCloud<pcl::PointXYZ>& cloud, int side,
                                            Wall& wall) {
  const double sign = kSides[static_cast<std::size_t>(side)];
  double sum = 0.0;
  for (const Taken& t : taken[static_cast<std::size_t>(side)]) {
    const CorridorNode& n = smoother.node(static_cast<std::size_t>(t.node));
    const double c = std::cos(n.pose.heading);
    const double s = std::sin(n.pose.heading);
    const double bend = n.curvature / std::max(0.2, 1.0 - sign * n.half_width * n.curvature);
    const PointGroup& g = groups[static_cast<std::size_t>(t.group)];
    for (int k = g.first; k < g.last; ++k) {
      const int index = order[static_cast<std::size_t>(k)];
      const pcl::PointXYZ& point = cloud.points[static_cast<std::size_t>(index)];
      const double along = c * (point.x - n.pose.x) + s * (point.y - n.pose.y);
      const double lateral = c * (point.y - n.pose.y) - s * (point.x - n.pose.x);
      const double miss = lateral - sign * n.half_width - 0.5 * bend * along * along;
      if (std::abs(miss) > p.inlier_distance) continue;
      sum += miss * miss;
      wall.indices.push_back(index);
    }
  }
  if (!wall.indices.empty()) wall.residual = std::sqrt(sum / static_cast<double>(wall.indices.size()));
  std::sort(wall.indices.begin(), wall.indices.end());
  // A group on the border of two slices may have been taken twice.
  wall.indices.erase(std::unique(wall.indices.begin(), wall.indices.end()), wall.indices.end());
}

}  // namespace tunnel_pilot::perception
