#include "tunnel_pilot/perception/wall_segmentation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "corridor_seed.h"
#include "corridor_smoother.h"
#include "point_grid.h"

namespace tunnel_pilot::perception {
namespace {

using geometry::Point;

constexpr std::size_t kMaxNodes = 100;  // slices across the tunnel
constexpr double kUnseenBeforeWidening =
    2.0;                               // [m] without either wall before another width is looked for
constexpr double kDisplacement = 2.0;  // [m] from a lost wall's place within which it may still be
constexpr int kDisplacedSlices = 3;
constexpr double kLooseWidthWalk = 0.25;    // [m per sqrt(m)]
constexpr double kLooseMargin = 0.10;       // of all slices that it must show more
constexpr double kTaperCoverage = 0.3;      // of the slice's length
constexpr double kWideningLength = 5.0;     // [m] over which it must show
constexpr double kWideningDeviation = 0.2;  // [m] of the new walls' places
constexpr double kCoverageMin = 0.1;        // of a slice's length
constexpr double kHuber = 1.5;              // deviations beyond which a slice counts less
constexpr double kCurveSpacing = 0.5;       // [m] of the fitted curves' samples
// With so much of the near stretch seen on the better wall, the last scan's tunnel holds; with so much
// on the worse, both walls do.
constexpr double kTrackedSupport = 0.6;
constexpr double kPairedSupport = 0.35;
constexpr int kScansToRevise = 10;  // with one wall alone
constexpr double kRevisionMargin = 0.20;
constexpr double kSeedMargin = 0.05;         // by which a less likely seed must explain more
constexpr double kWidthDeviationMin = 0.03;  // [m] of the last scan's half width
constexpr double kWidthDeviationMax = 0.15;  // [m]
constexpr Stamp kGuessAge = std::chrono::milliseconds(500);
constexpr std::array<double, 2> kSides = {1.0, -1.0};

// Returns near to where a wall is expected in one slice.
struct WallSlice {
  CorridorSmoother::Slice mean;
  int groups = 0;
  double coverage = 0.0;  // share of the slice's length
  double outward = 0.0;   // of the expected wall [m]
};

double square(double x) { return x * x; }

SliceFrame frameOf(const CorridorNode& node) {
  return {static_cast<float>(node.position.x()), static_cast<float>(node.position.y()),
          static_cast<float>(node.direction.cosine()), static_cast<float>(node.direction.sine())};
}

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
  p.width_change_min = node.number("width_change_min", "m", 0.01, 2.0);
  p.gap_max = node.number("gap_max", "m", 0.5, 20.0);
  p.wall_length_min = node.number("wall_length_min", "m", 0.5, 20.0);
  p.wall_coverage_min = node.number("wall_coverage_min", "1", 0.0, 1.0);
  p.inlier_distance = node.number("inlier_distance", "m", 0.01, 1.0);
  p.points_min = static_cast<int>(node.integer("points_min", "1", 2, 1000));
  node.finish();
  return p;
}

struct WallSegmentation::Impl {
  // Shares of the near slices in which a wall was seen [1].
  struct Support {
    double better = 0.0;
    double worse = 0.0;
    bool left_better = true;
    double total = 0.0;  // of all slices on both sides
  };

  explicit Impl(const WallSegmentationParameters& parameters)
      : p(parameters), seeder(p), smoother(square(p.curvature_walk), square(p.width_walk)) {}

  const WallSegmentationParameters p;
  CorridorSeeder seeder;
  CorridorSmoother smoother;
  PointGrid grid;
  std::vector<PointGroup> groups;
  std::vector<int> order;                          // finite points of the input, as indices
  std::vector<int> inliers;                        // as long as ever needed, so that nothing is cleared
  std::array<std::vector<std::int16_t>, 2> taken;  // by side and group: the node it was taken for, or -1
  std::array<std::vector<float>, 2> seen;  // by side and node: share of the slice that shows the wall

  void group(const pcl::PointCloud<pcl::PointXYZ>& cloud, const std::vector<int>& indices);
  // The centerline about every kCurveSpacing, from the first node of the curves on.
  struct Sample {
    Point center, to_left;
  };
  std::vector<Sample> samples;
  int samples_per_node = 1;

  std::optional<CorridorNode> guess;  // where the last scan's tunnel began
  Stamp guess_stamp{};
  double guess_width_deviation = 0.0;  // of its half width [m]
  bool guess_held = false;             // the present walls were found with its help
  int displaced = 0;                   // slices with one wall, and returns beside the other's place
  int unpaired_scans = 0;              // for which one wall alone held the guess

  void find(Stamp stamp);
  CorridorNode startOf(const CorridorSeed& seed) const;
  void follow(const CorridorNode& start, const CorridorSmoother::Vector& deviations, bool left,
              bool right);
  Support followWithLooseWidth(const Support& held);
  bool vote(double to_beat);
  double explained() const;
  double slicesAhead() const { return (p.lookahead + p.look_behind) / p.step; }
  void followSeed(const CorridorSeed& seed);
  bool followGuess(Stamp stamp);
  void keepGuess(Stamp stamp, const Walls& walls);
  void clear();
  Support support() const;
  bool widen(std::size_t node);
  bool measureSlice(const std::array<bool, 2>& followed);
  double deviationOf(std::size_t side) const;
  double gateOf(std::size_t side) const;
  WallSlice lookForWall(std::size_t side, double gate, const SliceFrame& frame, bool take = true);
  bool movedAlike(const std::array<WallSlice, 2>& slices) const;
  void taper(const SliceFrame& frame, std::array<WallSlice, 2>& slices);
  void measure(std::size_t side, const WallSlice& slice);
  std::size_t firstSeen() const;
  void finish(const pcl::PointCloud<pcl::PointXYZ>& cloud, std::size_t side, std::size_t first,
              Wall& wall);
  void collectInliers(const pcl::PointCloud<pcl::PointXYZ>& cloud, std::size_t side, Wall& wall);
  bool isWall(std::size_t side) const;
  void sampleCenterline(std::size_t first);
};

WallSegmentation::WallSegmentation(const WallSegmentationParameters& parameters)
    : impl_(new Impl(parameters)), parameters_(parameters) {}

WallSegmentation::~WallSegmentation() = default;

void WallSegmentation::reset() { impl_->guess.reset(); }

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
    impl_->find(stamp);
    const std::size_t first = impl_->firstSeen();
    impl_->sampleCenterline(first);
    impl_->finish(*input_, 0, first, walls_.left);
    impl_->finish(*input_, 1, first, walls_.right);
    impl_->keepGuess(stamp, walls_);
  }
  deinitCompute();
  return walls_;
}

// Walks along the returns and begins a group wherever one is farther than `spacing` from the last
// beginning.
void WallSegmentation::Impl::group(const pcl::PointCloud<pcl::PointXYZ>& cloud,
                                   const std::vector<int>& indices) {
  const auto reach_squared = static_cast<float>(square(p.spacing));
  groups.clear();
  order.resize(indices.size());
  int count = 0;
  float x0 = std::numeric_limits<float>::max();  // so that the first is far from it
  float y0 = 0.0F;
  for (const int index : indices) {
    const pcl::PointXYZ& point = cloud.points[static_cast<std::size_t>(index)];
    const float dx = point.x - x0;
    const float dy = point.y - y0;
    const float gap_squared = dx * dx + dy * dy;
    if (gap_squared != gap_squared) continue;  // a coordinate is NaN
    if (gap_squared > reach_squared) {
      if (!std::isfinite(point.x) || !std::isfinite(point.y)) continue;
      if (groups.size() == PointGrid::kMaxGroups) break;
      x0 = point.x;
      y0 = point.y;
      if (!groups.empty()) groups.back().last = count;
      groups.push_back({x0, y0, count, count});
    }
    order[static_cast<std::size_t>(count++)] = index;
  }
  if (!groups.empty()) groups.back().last = count;
  order.resize(static_cast<std::size_t>(count));
}

// The last scan's tunnel is the best first guess: beside a parked vehicle or an opening one wall shows
// where the other still is, and a vote would take the vehicle for it. Where the guess does not hold, or
// now and then while it holds on to one wall, the returns vote; the guess stays unless the vote explains
// more.
void WallSegmentation::Impl::find(Stamp stamp) {
  grid.fill(groups);
  guess_held = followGuess(stamp);
  double to_beat = 0.0;
  if (guess_held) {
    Support held = support();
    if (displaced >= kDisplacedSlices) held = followWithLooseWidth(held);
    unpaired_scans = held.worse >= kPairedSupport ? 0 : unpaired_scans + 1;
    const bool revise = unpaired_scans > 0 && unpaired_scans % kScansToRevise == 0;
    if (held.better >= kTrackedSupport && !revise) return;
    to_beat = explained() + kRevisionMargin;
  }
  if (vote(to_beat)) {
    guess_held = false;
    unpaired_scans = 0;
  } else if (guess_held) {
    followGuess(stamp);
  } else {
    clear();
  }
}

// Follows each of the seeds and keeps the one that explains most. False, with the walls in any state,
// when none explains more than `to_beat`.
bool WallSegmentation::Impl::vote(double to_beat) {
  std::optional<CorridorSeed> best;
  for (const CorridorSeed& seed : seeder.find(groups)) {
    followSeed(seed);
    const double score = explained();
    if (score <= to_beat) continue;
    to_beat = score + kSeedMargin;
    best = seed;
  }
  if (best) followSeed(*best);
  return best.has_value();
}

// Share of the slices that show the walls, less that in which something stands between them (half, as it
// can only be one wall): what stands there all along is a wall, and what was followed a bay's back.
double WallSegmentation::Impl::explained() const {
  int obstructed = 0;
  for (std::size_t i = 0; i < smoother.size(); ++i) {
    const CorridorNode& node = smoother.node(i);
    const double inner = node.half_width - p.gate_max;
    bool empty = true;
    grid.visitSlice(groups, frameOf(node), 0.5 * p.step, -inner, inner,
                    [&](int, float, float) { empty = false; });
    obstructed += empty ? 0 : 1;
  }
  return support().total - 0.5 * obstructed / slicesAhead();
}

// Twice, since a seed is coarse: the second time from where the first found the tunnel to begin.
void WallSegmentation::Impl::followSeed(const CorridorSeed& seed) {
  const bool paired = seed.left && seed.right;
  CorridorNode start = startOf(seed);
  for (int pass = 0; pass < 2; ++pass) {
    follow(start, {0.3, 0.15, 0.05, paired ? 0.3 : 1e-3}, seed.left.has_value(), seed.right.has_value());
    start = smoother.node(0);
  }
}

bool WallSegmentation::Impl::followGuess(Stamp stamp) {
  if (!guess || stamp < guess_stamp || stamp - guess_stamp > kGuessAge) return false;
  follow(*guess, {0.08, 0.06, 0.03, guess_width_deviation}, true, true);
  return true;
}

// Where one wall was lost though returns stand beside its place, the tunnel may have narrowed or widened
// and the other wall have been followed alone, to its side. With a width that may change at will both
// walls show; if they do, that is kept.
WallSegmentation::Impl::Support WallSegmentation::Impl::followWithLooseWidth(const Support& held) {
  smoother.setWidthNoise(square(kLooseWidthWalk));
  follow(*guess, {0.08, 0.06, 0.03, guess_width_deviation}, true, true);
  smoother.setWidthNoise(square(p.width_walk));
  const Support loose = support();
  if (loose.total > held.total + kLooseMargin) return loose;
  follow(*guess, {0.08, 0.06, 0.03, guess_width_deviation}, true, true);
  return held;
}

// Of the first slice that was seen, moved back along its arc to where the curves begin. A scan that
// shows no wall (dust, a dip that hides them) leaves the guess to the next one, until it is too old.
void WallSegmentation::Impl::keepGuess(Stamp stamp, const Walls& walls) {
  if (!walls.left.found && !walls.right.found) return;
  if (!guess && !(walls.left.found && walls.right.found)) return;
  const std::size_t first = firstSeen();
  CorridorNode next = smoother.node(first);
  const Support seen_near = support();
  if (guess && guess_held && seen_near.worse < kPairedSupport) {
    // One wall alone says nothing new about the width: the place of the better one counts.
    const double side = seen_near.left_better ? 1.0 : -1.0;
    const double shift = side * (next.half_width - guess->half_width);
    next.position += shift * next.direction.left();
    next.half_width = guess->half_width;
  } else {
    // Where the tunnel widens, the next scan meets what the next slice shows.
    const std::size_t ahead = std::min(first + 1, smoother.size() - 1);
    const double change = std::abs(smoother.node(ahead).half_width - next.half_width);
    const double deviation = std::max(std::sqrt(smoother.covariance(first)(3, 3)), 0.5 * change);
    guess_width_deviation = std::clamp(deviation, kWidthDeviationMin, kWidthDeviationMax);
  }
  next.move(-p.look_behind - next.position.dot(next.direction.along()));
  guess = next;
  guess_stamp = stamp;
}

// Counted from the first slice with any wall.
WallSegmentation::Impl::Support WallSegmentation::Impl::support() const {
  const auto near = static_cast<std::size_t>(p.seed_radius / p.step);
  std::size_t first = 0;
  while (first < near && first < seen[0].size() && seen[0][first] + seen[1][first] == 0.0F) ++first;
  std::array<double, 2> share{};
  for (std::size_t side = 0; side < 2; ++side) {
    const std::vector<float>& slices = seen[side];
    double count = 0.0;
    for (std::size_t i = first; i < std::min(first + near, slices.size()); ++i) count += slices[i];
    share[side] = count / static_cast<double>(near);
  }
  double total = 0.0;
  for (const std::vector<float>& slices : seen) {
    for (const float slice : slices) total += slice;
  }
  return {std::max(share[0], share[1]), std::min(share[0], share[1]), share[0] >= share[1],
          0.5 * total / slicesAhead()};
}

CorridorNode WallSegmentation::Impl::startOf(const CorridorSeed& seed) const {
  const double nominal = 0.5 * (p.width_min + p.width_max);
  const double left = seed.left ? *seed.left : *seed.right + nominal;
  const double right = seed.right ? *seed.right : *seed.left - nominal;
  const double middle = 0.5 * (left + right);
  CorridorNode node;
  node.curvature = seed.curvature / (1.0 - middle * seed.curvature);
  node.half_width = 0.5 * (left - right);
  // Back along the arc to where the curves shall begin.
  node.direction = Direction(seed.heading);
  node.position = middle * node.direction.left();
  node.move(-p.look_behind);
  return node;
}

void WallSegmentation::Impl::clear() {
  for (std::size_t side = 0; side < 2; ++side) {
    taken[side].assign(groups.size(), -1);
    seen[side].clear();
  }
}

void WallSegmentation::Impl::follow(const CorridorNode& start,
                                    const CorridorSmoother::Vector& deviations, bool left, bool right) {
  clear();
  displaced = 0;
  smoother.start(start, deviations);
  const std::array<bool, 2> followed = {left, right};
  const std::size_t nodes =
      std::min(static_cast<std::size_t>((p.lookahead + p.look_behind) / p.step), kMaxNodes);
  const auto widen_after = static_cast<std::size_t>(std::ceil(kUnseenBeforeWidening / p.step));
  std::size_t unseen = 0;      // slices without either wall, at the end
  std::size_t widened_at = 0;  // node at which a change of width was looked for last
  while (smoother.size() <= nodes) {
    const bool any = measureSlice(followed);
    unseen = any ? 0 : unseen + 1;
    if (static_cast<double>(unseen) * p.step > p.gap_max) break;
    const std::size_t first_unseen = smoother.size() - unseen;
    if (unseen == widen_after && first_unseen > widened_at) {
      widened_at = first_unseen;
      if (widen(first_unseen)) {
        unseen = 0;
        continue;
      }
    }
    smoother.advance(p.step);
  }
  smoother.smooth();
}

// Where both walls are lost at once, the tunnel may go on wider or narrower along the same line. If it
// does, goes back to the first slice without them and takes the new width from there.
bool WallSegmentation::Impl::widen(std::size_t node) {
  const CorridorNode& at = smoother.node(node);
  const CorridorSeed walls = seeder.findAlong(groups, frameOf(at), at.curvature, kWideningLength);
  if (!walls.left || !walls.right) return false;
  const double width = *walls.left - *walls.right;
  const double shift = 0.5 * (*walls.left + *walls.right);
  if (width < p.width_min || width > p.width_max || std::abs(shift) > p.gate_max) return false;
  smoother.rewind(node + 1);
  smoother.step(shift, 0.5 * width, kWideningDeviation, kWideningDeviation);
  for (std::vector<float>& slices : seen) slices.resize(node);
  return true;
}

// Measures the walls in the last node's slice; true when any was seen.
bool WallSegmentation::Impl::measureSlice(const std::array<bool, 2>& followed) {
  const SliceFrame slice_frame = frameOf(smoother.last());
  std::array<WallSlice, 2> slices;
  for (std::size_t side = 0; side < 2; ++side) {
    if (followed[side]) slices[side] = lookForWall(side, gateOf(side), slice_frame);
  }
  const bool lost = slices[0].groups * slices[1].groups == 0;
  if (followed[0] && followed[1] && (lost || movedAlike(slices))) taper(slice_frame, slices);
  for (std::size_t side = 0; side < 2; ++side) {
    if (!followed[side] || slices[side].groups > 0 || slices[1 - side].groups == 0) continue;
    displaced += lookForWall(side, kDisplacement, slice_frame, false).groups > 0 ? 1 : 0;
  }
  for (std::size_t side = 0; side < 2; ++side) {
    const bool measured = slices[side].groups > 0;
    if (measured) measure(side, slices[side]);
    seen[side].push_back(static_cast<float>(slices[side].coverage));
  }
  return slices[0].groups + slices[1].groups > 0;
}

double WallSegmentation::Impl::deviationOf(std::size_t side) const {
  return std::sqrt(smoother.expectedVariance(kSides[side]) + square(p.wall_deviation));
}

double WallSegmentation::Impl::gateOf(std::size_t side) const {
  return std::clamp(3.0 * deviationOf(side), p.gate_min, p.gate_max);
}

WallSlice WallSegmentation::Impl::lookForWall(std::size_t side, double gate, const SliceFrame& frame,
                                              bool take) {
  const CorridorNode& node = smoother.last();
  const double middle = kSides[side] * node.half_width;
  std::vector<std::int16_t>& mine = taken[side];
  const auto at = static_cast<std::int16_t>(smoother.size() - 1);
  int count = 0;
  float sum_along = 0.0F;
  float sum_along_squared = 0.0F;
  float sum_lateral = 0.0F;
  float nearest = std::numeric_limits<float>::max();
  float farthest = std::numeric_limits<float>::lowest();
  grid.visitSlice(groups, frame, 0.5 * p.step, middle - gate, middle + gate,
                  [&](int group, float along, float lateral) {
                    nearest = std::min(nearest, along);
                    farthest = std::max(farthest, along);
                    sum_along += along;
                    sum_along_squared += along * along;
                    sum_lateral += lateral;
                    ++count;
                    if (take) mine[static_cast<std::size_t>(group)] = at;
                  });
  WallSlice slice;
  if (count == 0) return slice;
  slice.groups = count;
  slice.mean.along = sum_along / static_cast<float>(count);
  slice.mean.along_squared = sum_along_squared / static_cast<float>(count);
  slice.mean.lateral = sum_lateral / static_cast<float>(count);
  slice.coverage = std::clamp((farthest - nearest) / p.step, kCoverageMin, 1.0);
  slice.outward = kSides[side] * slice.mean.lateral - node.half_width;
  return slice;
}

// Both walls stand farther out, or farther in, than expected, by about as much.
bool WallSegmentation::Impl::movedAlike(const std::array<WallSlice, 2>& slices) const {
  const double left = slices[0].outward;
  const double right = slices[1].outward;
  return left * right > 0.0 && std::min(std::abs(left), std::abs(right)) >= p.width_change_min &&
         std::abs(left - right) <= p.gate_min &&
         std::min(slices[0].coverage, slices[1].coverage) >= kTaperCoverage;
}

// Where both walls moved alike, the tunnel's width changes; an obstacle or a bay moves only one.
void WallSegmentation::Impl::taper(const SliceFrame& frame, std::array<WallSlice, 2>& slices) {
  const std::array<WallSlice, 2> wide = {lookForWall(0, p.gate_max, frame),
                                         lookForWall(1, p.gate_max, frame)};
  if (!movedAlike(wide)) return;
  const double change = 0.5 * (wide[0].outward + wide[1].outward);
  smoother.step(0.0, smoother.last().half_width + change, 0.0, p.wall_deviation);
  slices = wide;
}

void WallSegmentation::Impl::measure(std::size_t side, const WallSlice& slice) {
  // Half a wall and half something before it make an outlier: the farther off, the less it counts
  // (Huber). The face of something that juts out of the wall is short along it, and so counts little.
  const double miss = std::abs(kSides[side] * slice.mean.lateral - smoother.last().half_width);
  const double doubt = std::max(1.0, miss / (kHuber * deviationOf(side)));
  smoother.measure(kSides[side], slice.mean, doubt / slice.coverage * square(p.wall_deviation));
}

bool WallSegmentation::Impl::isWall(std::size_t side) const {
  const std::vector<float>& slices = seen[side];
  const auto is_seen = [](float share) { return share > 0.0F; };
  const auto count = static_cast<double>(std::count_if(slices.begin(), slices.end(), is_seen));
  if (count * p.step < p.wall_length_min) return false;
  const auto first = std::find_if(slices.begin(), slices.end(), is_seen);
  const auto last = std::find_if(slices.rbegin(), slices.rend(), is_seen).base();
  return count >= p.wall_coverage_min * static_cast<double>(std::distance(first, last));
}

// The first slice in which a wall was measured: both curves begin there, so that their samples pair up.
std::size_t WallSegmentation::Impl::firstSeen() const {
  std::size_t first = smoother.size();
  for (std::size_t side = 0; side < 2; ++side) {
    if (!isWall(side)) continue;
    for (std::size_t i = 0; i < first; ++i) {
      if (seen[side][i] > 0.0F) first = i;
    }
  }
  return first;
}

void WallSegmentation::Impl::finish(const pcl::PointCloud<pcl::PointXYZ>& cloud, std::size_t side,
                                    std::size_t first, Wall& wall) {
  if (!isWall(side)) return;
  wall.found = true;
  std::size_t last = seen[side].size() - 1;
  while (seen[side][last] == 0.0F) --last;
  const std::size_t count = (last - first) * static_cast<std::size_t>(samples_per_node) + 1;
  for (std::size_t k = 0; k < count; ++k) {
    wall.curve.push_back(samples[k].center + kSides[side] * samples[k].to_left);
  }
  collectInliers(cloud, side, wall);
}

// Samples of the centerline from node `first` on, with the way from it to the left wall: cubic Hermite
// pieces between the nodes.
void WallSegmentation::Impl::sampleCenterline(std::size_t first) {
  samples_per_node = std::max(1, static_cast<int>(std::lround(p.step / kCurveSpacing)));
  samples.clear();
  for (std::size_t i = first; i < smoother.size(); ++i) {
    const CorridorNode& a = smoother.node(i);
    samples.push_back({a.position, a.half_width * a.direction.left()});
    if (i + 1 == smoother.size()) break;
    const CorridorNode& b = smoother.node(i + 1);
    for (int j = 1; j < samples_per_node; ++j) {
      const double t = static_cast<double>(j) / samples_per_node;
      const Point chord = b.position - a.position;
      const Point center = a.position + t * t * (3.0 - 2.0 * t) * chord +
                           p.step * t * square(1.0 - t) * a.direction.along() +
                           p.step * t * t * (t - 1.0) * b.direction.along();
      const Point left = ((1.0 - t) * a.direction.left() + t * b.direction.left()).normalized();
      samples.push_back({center, (a.half_width + t * (b.half_width - a.half_width)) * left});
    }
  }
}

void WallSegmentation::Impl::collectInliers(const pcl::PointCloud<pcl::PointXYZ>& cloud,
                                            std::size_t side, Wall& wall) {
  struct Line {
    SliceFrame frame;
    float offset, half_bend;
  };
  std::array<Line, kMaxNodes + 1> lines;
  for (std::size_t i = 0; i < smoother.size(); ++i) {
    const CorridorNode& n = smoother.node(i);
    const double offset = kSides[side] * n.half_width;
    const double bend = n.curvature / std::max(0.2, 1.0 - offset * n.curvature);
    lines[i] = {frameOf(n), static_cast<float>(offset), static_cast<float>(0.5 * bend)};
  }
  const auto reach = static_cast<float>(p.inlier_distance);
  const std::vector<std::int16_t>& node_of = taken[side];
  inliers.resize(std::max(inliers.size(), order.size()));
  std::size_t count = 0;
  float sum = 0.0F;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const int node = node_of[g];
    if (node < 0) continue;
    const Line& n = lines[static_cast<std::size_t>(node)];
    for (int k = groups[g].first; k < groups[g].last; ++k) {
      const int index = order[static_cast<std::size_t>(k)];
      const pcl::PointXYZ& point = cloud.points[static_cast<std::size_t>(index)];
      const float dx = point.x - n.frame.x;
      const float dy = point.y - n.frame.y;
      const float along = n.frame.cosine * dx + n.frame.sine * dy;
      const float miss =
          n.frame.cosine * dy - n.frame.sine * dx - n.offset - n.half_bend * along * along;
      const bool on_wall = std::abs(miss) <= reach;
      inliers[count] = index;
      count += on_wall ? 1 : 0;
      sum += on_wall ? miss * miss : 0.0F;
    }
  }
  wall.indices.assign(inliers.begin(), inliers.begin() + static_cast<std::ptrdiff_t>(count));
  if (count > 0) wall.residual = std::sqrt(static_cast<double>(sum) / static_cast<double>(count));
}

}  // namespace tunnel_pilot::perception
