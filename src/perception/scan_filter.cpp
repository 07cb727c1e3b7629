#include "tunnel_pilot/perception/scan_filter.h"

#include <pcl/common/point_tests.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace tunnel_pilot::perception {
namespace {

constexpr double kDegree = 0.017453292519943295;  // [rad]
constexpr double kNetworkFirst = -95.0 * kDegree;
constexpr double kNetworkIncrement = 0.25 * kDegree;
constexpr double kTurn = 360.0 * kDegree;
constexpr double kNeededView = 90.0 * kDegree;  // either side
constexpr double kSideSector = 30.0 * kDegree;  // from here to kNeededView
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

bool sameBytes(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

// Written so that numbers that are none fail.
bool wellFormed(const geometry::Scan& scan, const geometry::Pose& sensor) {
  const bool angles = std::abs(scan.angle_min) <= kTurn && std::abs(scan.angleMax()) <= kTurn &&
                      scan.angle_increment > 0.0 && scan.angle_increment <= kTurn;
  return angles && std::isfinite(scan.range_min) && scan.range_min >= 0.0 &&
         scan.range_max > scan.range_min && std::isfinite(sensor.x) && std::isfinite(sensor.y) &&
         std::isfinite(sensor.heading);
}

std::uint8_t sectorOf(double angle) {
  if (std::abs(angle) > kNeededView) return 3;
  if (angle > kSideSector) return 0;
  return angle < -kSideSector ? 2 : 1;
}

}  // namespace

ScanFilterParameters loadScanFilter(config::Node node) {
  ScanFilterParameters p;
  p.range_min = node.number("range_min", "m", 0.0, 5.0);
  p.range_max = node.number("range_max", "m", 5.0, 500.0);
  p.check_age = node.boolean("check_age");
  p.max_future = node.number("max_future", "s", 0.0, 1.0);
  p.max_age = node.number("max_age", "s", 0.01, 5.0);
  p.frozen_count = static_cast<int>(node.integer("frozen_count", "1", 2, 100));
  p.isolation_window = static_cast<int>(node.integer("isolation_window", "1", 1, 10));
  p.isolation_min_neighbors =
      static_cast<int>(node.integer("isolation_min_neighbors", "1", 0, 2L * p.isolation_window));
  p.isolation_distance = node.number("isolation_distance", "m", 0.0, 1.0);
  p.isolation_slope = node.number("isolation_slope", "1", 0.0, 0.5);
  p.gap_max = node.number("gap_max", "rad", 0.0, 0.5);
  node.finish();
  return p;
}

ScanFilter::ScanFilter(const ScanFilterParameters& parameters)
    : parameters_(parameters), beams_(new pcl::PointCloud<pcl::PointXYZ>) {
  isolated_.setWindow(parameters_.isolation_window);
  isolated_.setMinNeighbors(parameters_.isolation_min_neighbors);
  isolated_.setDistance(static_cast<float>(parameters_.isolation_distance));
  isolated_.setSlope(static_cast<float>(parameters_.isolation_slope));
  result_.points.reset(new pcl::PointCloud<pcl::PointXYZ>);
}

std::uint64_t ScanFilter::rejected() const {
  return std::accumulate(counts_.begin() + 1, counts_.end(), std::uint64_t{0});
}

void ScanFilter::reset() {
  announced_ = false;
  last_stamp_.reset();
}

const ScanFilter::Result& ScanFilter::filter(const geometry::Scan& scan,
                                             const geometry::Pose& sensor_in_base, Stamp now) {
  if (result_.points.use_count() > 1) result_.points.reset(new pcl::PointCloud<pcl::PointXYZ>);
  result_.valid_fraction = {};
  result_.rejection = check(scan, sensor_in_base, now);
  result_.accepted = result_.rejection == Rejection::kNone;
  ++counts_[static_cast<std::size_t>(result_.rejection)];
  if (!result_.accepted) {
    result_.points->clear();
    result_.network_scan.ranges.clear();
    return result_;
  }
  last_stamp_ = scan.stamp;
  makeCloud(scan);
  gatherPoints();
  measureSectors(scan);
  makeNetworkScan(scan);
  return result_;
}

ScanFilter::Rejection ScanFilter::check(const geometry::Scan& scan, const geometry::Pose& sensor,
                                        Stamp now) {
  Rejection rejection = checkGeometry(scan, sensor);
  if (rejection == Rejection::kNone) rejection = checkStamp(scan.stamp, now);
  if (rejection == Rejection::kNone) rejection = checkRanges(scan);
  if (rejection != Rejection::kNone) return rejection;
  const bool moved = sensor.x != sensor_.x || sensor.y != sensor_.y || sensor.heading != sensor_.heading;
  if (!announced_ || moved) adopt(scan, sensor);
  return Rejection::kNone;
}

ScanFilter::Rejection ScanFilter::checkGeometry(const geometry::Scan& scan,
                                                const geometry::Pose& sensor) const {
  if (!wellFormed(scan, sensor)) return Rejection::kMalformed;
  if (scan.ranges.size() < 2) return Rejection::kWrongSize;
  const double announced_end = scan.announced_angle_max;
  if (!std::isnan(announced_end) &&
      !(std::abs(scan.angleMax() - announced_end) <= 0.6 * scan.angle_increment)) {
    return Rejection::kWrongSize;
  }
  if (announced_) {
    const double tolerance = 1e-3 * model_.angle_increment;
    const bool same = std::abs(scan.angle_min - model_.angle_min) <= tolerance &&
                      std::abs(scan.angleMax() - model_.angleMax()) <= tolerance &&
                      scan.ranges.size() == model_.ranges.size() && scan.range_min == model_.range_min &&
                      scan.range_max == model_.range_max;
    if (!same) return Rejection::kGeometryChanged;
  }
  const double slack = 0.5 * scan.angle_increment;
  if (scan.angle_min + sensor.heading > -kNeededView + slack ||
      scan.angleMax() + sensor.heading < kNeededView - slack) {
    return Rejection::kFieldOfView;
  }
  return Rejection::kNone;
}

ScanFilter::Rejection ScanFilter::checkStamp(Stamp stamp, Stamp now) const {
  if (last_stamp_ && stamp == *last_stamp_) return Rejection::kRepeated;
  if (last_stamp_ && stamp < *last_stamp_) return Rejection::kBackward;
  if (!parameters_.check_age) return Rejection::kNone;
  const double age = toSeconds(now - stamp);
  if (age < -parameters_.max_future) return Rejection::kFuture;
  return age > parameters_.max_age ? Rejection::kTooOld : Rejection::kNone;
}

ScanFilter::Rejection ScanFilter::checkRanges(const geometry::Scan& scan) {
  const auto low = static_cast<float>(std::max(parameters_.range_min, scan.range_min));
  const auto high = static_cast<float>(std::min(parameters_.range_max, scan.range_max));
  constexpr float kLargest = std::numeric_limits<float>::max();
  int nan = 0;
  int infinite = 0;
  int negative = 0;
  int usable = 0;
  for (const float r : scan.ranges) {
    nan += static_cast<int>(r != r);
    infinite += static_cast<int>(r > kLargest) + static_cast<int>(r < -kLargest);
    negative += static_cast<int>(r < 0.0F) - static_cast<int>(r < -kLargest);
    usable += static_cast<int>(r >= low) & static_cast<int>(r <= high);
  }
  const int size = static_cast<int>(scan.ranges.size());
  if (nan == size) return Rejection::kAllNan;
  if (infinite == size) return Rejection::kAllInfinite;
  if (negative > 0) return Rejection::kNegative;
  // Compared with the last that could be used: one that cannot, in between, freshens no frozen ones.
  identical_ = sameBytes(scan.ranges, last_ranges_) ? identical_ + 1 : 1;
  last_ranges_ = scan.ranges;
  if (identical_ >= parameters_.frozen_count) return Rejection::kFrozen;
  return usable == 0 ? Rejection::kNoReturns : Rejection::kNone;
}

void ScanFilter::adopt(const geometry::Scan& scan, const geometry::Pose& sensor) {
  announced_ = true;
  model_ = scan;
  sensor_ = sensor;
  const std::size_t size = scan.ranges.size();
  cosines_.resize(size);
  sines_.resize(size);
  sectors_.resize(size);
  sector_sizes_ = {};
  for (std::size_t i = 0; i < size; ++i) {
    const double angle = scan.angle(i) + sensor.heading;
    cosines_[i] = static_cast<float>(std::cos(angle));
    sines_[i] = static_cast<float>(std::sin(angle));
    sectors_[i] = sectorOf(angle);
    if (sectors_[i] < sector_sizes_.size()) ++sector_sizes_[sectors_[i]];
  }
  adoptSources(scan.angle_min + sensor.heading, scan.angle_increment, static_cast<int>(size));
}

void ScanFilter::adoptSources(double angle_min, double angle_increment, int size) {
  sources_.resize(kNetworkBeams);
  same_beams_ = size == kNetworkBeams;
  for (int i = 0; i < kNetworkBeams; ++i) {
    double at = (kNetworkFirst + i * kNetworkIncrement - angle_min) / angle_increment;
    if (std::abs(at - std::round(at)) < 1e-3) at = std::round(at);
    const int first = std::min(static_cast<int>(std::floor(at)), size - 2);
    const bool seen = at >= 0.0 && at <= size - 1;
    sources_[static_cast<std::size_t>(i)] = {seen ? first : -1, static_cast<float>(at - first)};
    same_beams_ = same_beams_ && at == i;
  }
}

void ScanFilter::makeCloud(const geometry::Scan& scan) {
  const auto low = static_cast<float>(std::max(parameters_.range_min, scan.range_min));
  const auto high = static_cast<float>(std::min(parameters_.range_max, scan.range_max));
  const auto x0 = static_cast<float>(sensor_.x);
  const auto y0 = static_cast<float>(sensor_.y);
  const std::size_t size = scan.ranges.size();
  beams_->resize(size);
  beams_->is_dense = false;
  beams_->sensor_origin_ = Eigen::Vector4f(x0, y0, 0.0F, 1.0F);
  for (std::size_t i = 0; i < size; ++i) {
    const float range = scan.ranges[i];
    const float r = range >= low && range <= high ? range : kNan;
    pcl::PointXYZ& p = beams_->points[i];
    p.x = x0 + r * cosines_[i];
    p.y = y0 + r * sines_[i];
    p.z = 0.0F;
  }
}

void ScanFilter::gatherPoints() {
  isolated_.setInputCloud(beams_);
  isolated_.filter(kept_);
  pcl::PointCloud<pcl::PointXYZ>& points = *result_.points;
  points.resize(kept_.size());
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    points.points[k] = beams_->points[static_cast<std::size_t>(kept_[k])];
  }
  points.is_dense = true;
  points.sensor_origin_ = beams_->sensor_origin_;
}

// Ranges of the beams whose return stayed, NaN for the others, and what share they are of each sector.
void ScanFilter::measureSectors(const geometry::Scan& scan) {
  std::array<int, 4> valid{};  // the last counts beams of no sector
  clean_.assign(scan.ranges.size(), kNan);
  for (const int beam : kept_) {
    const auto i = static_cast<std::size_t>(beam);
    clean_[i] = scan.ranges[i];
    ++valid[sectors_[i]];
  }
  for (std::size_t s = 0; s < sector_sizes_.size(); ++s) {
    result_.valid_fraction[s] = sector_sizes_[s] > 0 ? double(valid[s]) / sector_sizes_[s] : 0.0;
  }
}

void ScanFilter::makeNetworkScan(const geometry::Scan& scan) {
  geometry::Scan& out = result_.network_scan;
  out.stamp = scan.stamp;
  out.angle_min = kNetworkFirst - sensor_.heading;
  out.angle_increment = kNetworkIncrement;
  out.announced_angle_max = out.angle_min + (kNetworkBeams - 1) * kNetworkIncrement;
  out.time_increment = scan.time_increment * kNetworkIncrement / scan.angle_increment;
  out.range_min = std::max(parameters_.range_min, scan.range_min);
  out.range_max = std::min(parameters_.range_max, scan.range_max);
  // A beam without a return keeps what it says: nothing there, or nothing known.
  for (std::size_t i = 0; i < clean_.size(); ++i) {
    const bool nothing = scan.ranges[i] > std::numeric_limits<float>::max();
    clean_[i] = nothing ? kInfinity : clean_[i];
  }
  if (same_beams_) {
    out.ranges = clean_;
  } else {
    resample(out.ranges);
  }
  fillGaps(out.ranges);
}

void ScanFilter::resample(std::vector<float>& ranges) const {
  ranges.resize(kNetworkBeams);
  for (std::size_t i = 0; i < kNetworkBeams; ++i) {
    const Source source = sources_[i];
    if (source.first < 0) {
      ranges[i] = kNan;
      continue;
    }
    const auto a = static_cast<std::size_t>(source.first);
    const float ra = clean_[a];
    const float rb = clean_[a + 1];
    // Between two beams on one surface the range is interpolated; over an edge it is the nearer beam's.
    const bool one_surface = std::abs(ra - rb) <= 0.1F * (ra + rb) && ra < kInfinity;
    ranges[i] = one_surface ? ra + source.fraction * (rb - ra) : (source.fraction < 0.5F ? ra : rb);
  }
}

void ScanFilter::fillGaps(std::vector<float>& ranges) const {
  const std::size_t size = ranges.size();
  const auto widest = static_cast<std::size_t>(parameters_.gap_max / kNetworkIncrement);
  const auto missing = [&](std::size_t i) { return !(ranges[i] < kInfinity); };
  for (std::size_t first = 0; first < size; ++first) {
    if (!missing(first)) continue;
    std::size_t end = first + 1;
    while (end < size && missing(end)) ++end;
    const std::size_t gap = end - first;
    if (first > 0 && end < size && gap <= widest) {
      const float from = ranges[first - 1];
      const float step = (ranges[end] - from) / static_cast<float>(gap + 1);
      for (std::size_t j = 0; j < gap; ++j) ranges[first + j] = from + static_cast<float>(j + 1) * step;
    }
    first = end;
  }
}

std::string toString(ScanFilter::Rejection rejection) {
  using Rejection = ScanFilter::Rejection;
  switch (rejection) {
    case Rejection::kNone:
      return "accepted";
    case Rejection::kMalformed:
      return "angles, range limits or the sensor's pose make no sense";
    case Rejection::kWrongSize:
      return "number of ranges does not suit the angles";
    case Rejection::kFieldOfView:
      return "view does not cover 90 degrees either side";
    case Rejection::kGeometryChanged:
      return "geometry differs from the first scan's";
    case Rejection::kAllNan:
      return "every range is NaN";
    case Rejection::kAllInfinite:
      return "every range is infinite";
    case Rejection::kNegative:
      return "negative range";
    case Rejection::kNoReturns:
      return "no return within the range limits";
    case Rejection::kFuture:
      return "stamp lies in the future";
    case Rejection::kTooOld:
      return "stamp is too old";
    case Rejection::kRepeated:
      return "stamp repeats the last scan's";
    case Rejection::kBackward:
      return "stamp lies before the last scan's";
    case Rejection::kFrozen:
      return "ranges are frozen";
  }
  return "unknown rejection";
}

}  // namespace tunnel_pilot::perception
