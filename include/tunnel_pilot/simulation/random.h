#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

namespace tunnel_pilot::simulation {

/// What a stream of random numbers is for. Each has its own, so that a draw more in one place changes
/// nothing in another. Numbers are part of "same scenario, same seed, same bytes": never reused.
enum class Stream : std::uint64_t {
  kLidar = 1,
  kDust = 2,
  kArticulation = 3,
  kSpeed = 4,
  kGyro = 5,
  kSensedPath = 6,
  kRoad = 7,
  kPlantVariation = 8,
  kWander = 9,
  kAccelerometer = 10,
  kArticulationRate = 11,
  kScene = 12,
  kTraining = 13,
  kFaults = 14,
};

/// Seed of one stream of one scenario seed (SplitMix64 of both, Steele, Lea & Flood 2014).
std::uint64_t streamSeed(std::uint64_t seed, Stream stream);

/// `count` equally likely values that stand for the standard normal distribution: its quantiles in the
/// middles of `count` equal parts, scaled to unit variance. Ascending; mean 0.
std::vector<double> normalLevels(std::size_t count);

/// Random numbers that are the same on every platform (the standard library's distributions are not):
/// bits by xoshiro256++ (Blackman & Vigna 2021), normal numbers by linear interpolation in a table of
/// the half-normal quantile function, scaled to unit variance exactly; |normal| never exceeds about 5.
class Random {
 public:
  Random(std::uint64_t seed, Stream stream);

  /// 64 independent random bits.
  std::uint64_t bits() {
    const std::uint64_t result = rotate(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = rotate(state_[3], 45);
    return result;
  }

  /// Uniform in [0, 1), and in [min, max).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double uniform(double min, double max) { return min + (max - min) * uniform(); }

  /// Standard normal.
  double normal() {
    const std::uint64_t bits = this->bits();
    const auto cell = static_cast<std::size_t>(bits >> 53) & (kCells - 1);
    double value;
    if (cell != kCells - 1) {
      value = interpolate(table_->body, cell, static_cast<double>((bits >> 33) & 0xFFFFF) * 0x1p-20);
    } else {
      const auto tail_cell = static_cast<std::size_t>(bits >> 43) & (kCells - 1);
      value = interpolate(table_->tail, tail_cell, static_cast<double>((bits >> 33) & 0x3FF) * 0x1p-10);
    }
    return withSignOf(value, bits);
  }

 private:
  static constexpr std::size_t kCells = 1024;

  /// Quantiles of |normal| at probabilities i/1024, and inside the last of these cells.
  struct NormalTable {
    NormalTable();
    double variance() const;
    std::array<double, kCells + 1> body;
    std::array<double, kCells + 1> tail;
  };

  static const NormalTable& normalTable();

  static std::uint64_t rotate(std::uint64_t value, int by) {
    return (value << by) | (value >> (64 - by));
  }

  static double interpolate(const std::array<double, kCells + 1>& knots, std::size_t cell,
                            double fraction) {
    return knots[cell] + fraction * (knots[cell + 1] - knots[cell]);
  }

  static double withSignOf(double magnitude, std::uint64_t sign_bits) {
    std::uint64_t image;
    std::memcpy(&image, &magnitude, sizeof image);
    image |= sign_bits & (std::uint64_t{1} << 63);
    std::memcpy(&magnitude, &image, sizeof image);
    return magnitude;
  }

  std::array<std::uint64_t, 4> state_;
  const NormalTable* table_;
};

}  // namespace tunnel_pilot::simulation
