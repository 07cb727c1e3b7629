#include "tunnel_pilot/simulation/lidar_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr float kNoEcho = std::numeric_limits<float>::infinity();

DustParameters loadDust(config::Node node) {
  DustParameters dust;
  dust.dropout_min = node.number("dropout_min", "1", 0.0, 1.0);
  dust.dropout_max = node.number("dropout_max", "1", dust.dropout_min, 1.0);
  dust.early_return_share = node.number("early_return_share", "1", 0.0, 1.0);
  dust.burst_rate = node.number("burst_rate", "1/s", 0.0, 10.0);
  dust.burst_duration = node.number("burst_duration", "s", 0.0, 60.0);
  dust.burst_width = node.number("burst_width", "rad", 0.0, kTurn);
  dust.burst_dropout = node.number("burst_dropout", "1", 0.0, 1.0);
  node.finish();
  return dust;
}

// A probability as a threshold for 32 random bits.
std::uint64_t share32(double share) { return static_cast<std::uint64_t>(share * 0x1p32); }

// Pose between two near ones; `share` 0 gives the first.
geometry::Pose between(const geometry::Pose& first, const geometry::Pose& last, double share) {
  return {first.x + share * (last.x - first.x), first.y + share * (last.y - first.y),
          first.heading + share * geometry::wrapAngle(last.heading - first.heading)};
}

}  // namespace

LidarParameters loadLidar(config::Node node) {
  LidarParameters lidar;
  lidar.rate = node.number("rate", "Hz", 1.0, 100.0);
  lidar.latency = node.number("latency", "s", 0.0, 1.0);
  lidar.angle_min = node.number("angle_min", "rad", -kTurn / 2, kTurn / 2);
  lidar.angle_increment = node.number("angle_increment", "rad", 1e-4, 0.1);
  lidar.beams = static_cast<int>(node.integer("beams", "1", 2, 10000));
  lidar.range_min = node.number("range_min", "m", 0.0, 10.0);
  lidar.range_max = node.number("range_max", "m", 1.0, 1000.0);
  lidar.range_sigma = node.number("range_sigma", "m", 0.0, 1.0);
  lidar.range_bias_max = node.number("range_bias_max", "m", 0.0, 1.0);
  lidar.sectors = static_cast<int>(node.integer("sectors", "1", 1, lidar.beams));
  lidar.dust = loadDust(node.child("dust"));
  if ((lidar.beams - 1) * lidar.angle_increment >= kTurn) {
    node.refuse("beams", "times angle_increment is more than a turn");
  }
  const double sweep = (lidar.beams - 1) * lidar.angle_increment / (kTurn * lidar.rate);
  if (lidar.latency < sweep) node.refuse("latency", "[s] is shorter than the sweep itself");
  node.finish();
  return lidar;
}

world::RayCaster::Beams LidarModel::beams(const LidarParameters& parameters) {
  return {parameters.angle_min, parameters.angle_increment, parameters.beams, parameters.range_max};
}

LidarModel::LidarModel(const LidarParameters& parameters, std::uint64_t seed)
    : parameters_(parameters),
      noise_(seed, Stream::kLidar),
      dust_(seed, Stream::kDust),
      burst_end_(Stamp::min()) {
  bias_ = noise_.uniform(-parameters.range_bias_max, parameters.range_bias_max);
  static const std::vector<double> levels = normalLevels(std::size_t{1} << kErrorBits);
  std::transform(levels.begin(), levels.end(), errors_.begin(), [&](double level) {
    return static_cast<float>(bias_ + parameters.range_sigma * level);
  });
  dropout_ = dust_.uniform(parameters.dust.dropout_min, parameters.dust.dropout_max);
  scan_.angle_min = parameters.angle_min;
  scan_.angle_increment = parameters.angle_increment;
  scan_.time_increment = parameters.angle_increment / (kTurn * parameters.rate);
  scan_.range_min = parameters.range_min;
  scan_.range_max = parameters.range_max;
  scan_.ranges.resize(static_cast<std::size_t>(parameters.beams));
}

double LidarModel::sweepDuration() const { return scan_.time_increment * (parameters_.beams - 1); }

const geometry::Scan& LidarModel::sweep(const world::RayCaster& caster, const geometry::Pose& first,
                                        const geometry::Pose& last, double height, double pitch,
                                        Stamp stamp) {
  scan_.stamp = stamp;
  cast(caster, first, last);
  hideBehindGround(height, pitch);
  addNoiseAndDust();
  addBurst(stamp);
  return scan_;
}

void LidarModel::cast(const world::RayCaster& caster, const geometry::Pose& first,
                      const geometry::Pose& last) {
  for (int sector = 0; sector < parameters_.sectors; ++sector) {
    const int begin = parameters_.beams * sector / parameters_.sectors;
    const int end = parameters_.beams * (sector + 1) / parameters_.sectors;
    const double share = 0.5 * (begin + end - 1) / (parameters_.beams - 1);
    caster.cast(between(first, last, share), scan_.ranges.data(), begin, end);
  }
}

// A beam at angle a to the nose drops by tan(pitch) cos(a) a metre: it meets the ground at
// height / (tan(pitch) cos(a)).
void LidarModel::hideBehindGround(double height, double pitch) {
  const double slope = std::tan(pitch);
  if (std::abs(slope) * parameters_.range_max <= height) return;
  for (std::size_t i = 0; i < scan_.ranges.size(); ++i) {
    const double drop = slope * std::cos(scan_.angle(i));
    if (drop > 0.0) scan_.ranges[i] = std::min(scan_.ranges[i], static_cast<float>(height / drop));
  }
}

// The inner loop of the simulator: one draw of random bits a beam serves noise and dust. Only the rare
// early return branches; the generator works on a copy, so that its state stays in registers.
void LidarModel::addNoiseAndDust() {
  const std::uint64_t met_by_dust = share32(dropout_);
  const std::uint64_t early = share32(dropout_ * parameters_.dust.early_return_share);
  const auto range_min = static_cast<float>(parameters_.range_min);
  const auto range_max = static_cast<float>(parameters_.range_max);
  Random noise = noise_;
  for (float& range : scan_.ranges) {
    const std::uint64_t bits = noise.bits();
    const std::uint64_t lot = bits & 0xFFFFFFFFu;
    const float wall = range;
    float measured = wall + errors_[bits >> (64 - kErrorBits)];
    measured = measured < range_min ? -kNoEcho : measured;
    measured = measured > range_max ? kNoEcho : measured;
    range = lot < met_by_dust ? kNoEcho : measured;
    if (lot < early) {
      range = range_min + (std::min(wall, range_max) - range_min) * static_cast<float>(dust_.uniform());
    }
  }
  noise_ = noise;
}

void LidarModel::addBurst(Stamp stamp) {
  const DustParameters& dust = parameters_.dust;
  if (stamp >= burst_end_) {
    if (dust_.uniform() >= dust.burst_rate / parameters_.rate) return;
    burst_direction_ = dust_.uniform(scan_.angle_min, scan_.angleMax());
    burst_end_ = stamp + fromSeconds(dust.burst_duration * dust_.uniform(0.5, 1.5));
  }
  for (std::size_t i = 0; i < scan_.ranges.size(); ++i) {
    if (std::abs(scan_.angle(i) - burst_direction_) > 0.5 * dust.burst_width) continue;
    if (dust_.uniform() < dust.burst_dropout) scan_.ranges[i] = std::numeric_limits<float>::quiet_NaN();
  }
}

}  // namespace tunnel_pilot::simulation
