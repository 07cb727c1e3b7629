#include "tunnel_pilot/simulation/random.h"

#include <cmath>

namespace tunnel_pilot::simulation {
namespace {

std::uint64_t splitMix(std::uint64_t& state) {
  state += 0x9E3779B97F4A7C15u;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

// Solves erfc(x / sqrt 2) = outside for x >= 0 by bisection: slow, sure, and done once.
double halfNormalQuantile(double outside) {
  double low = 0.0;
  double high = 8.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle * std::sqrt(0.5)) > outside ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Libraries differ in the last digits of erfc: round them away, so that every platform has one table.
double rounded(double value) { return std::round(value * 0x1p30) * 0x1p-30; }

// Mean square of a number uniform in probability between the knots of a cell.
double meanSquare(double a, double b) { return (a * a + a * b + b * b) / 3.0; }

}  // namespace

std::uint64_t streamSeed(std::uint64_t seed, Stream stream) {
  std::uint64_t state = seed;
  state = splitMix(state) ^ static_cast<std::uint64_t>(stream);
  return splitMix(state);
}

std::vector<double> normalLevels(std::size_t count) {
  std::vector<double> levels(count);
  double squares = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(count) - 1.0;
    levels[i] = std::copysign(halfNormalQuantile(1.0 - std::abs(share)), share);
    squares += levels[i] * levels[i];
  }
  const double scale = std::sqrt(static_cast<double>(count) / squares);
  for (double& level : levels) level = rounded(level * scale);
  return levels;
}

Random::NormalTable::NormalTable() {
  constexpr double kCellWidth = 1.0 / kCells;
  constexpr double kTailCellWidth = kCellWidth / kCells;
  // The outermost cell reaches to infinity; its outer knot is set where the mean square of a line
  // through the cell comes near that of the true tail.
  constexpr double kOuterShare = 0.15;
  for (std::size_t i = 0; i < kCells; ++i) {
    body[i] = halfNormalQuantile(1.0 - static_cast<double>(i) * kCellWidth);
    tail[i] = halfNormalQuantile(kCellWidth - static_cast<double>(i) * kTailCellWidth);
  }
  tail[kCells] = halfNormalQuantile(kTailCellWidth * kOuterShare);
  body[kCells] = tail[kCells];
  const double scale = 1.0 / std::sqrt(variance());
  for (double& knot : body) knot = rounded(knot * scale);
  for (double& knot : tail) knot = rounded(knot * scale);
}

double Random::NormalTable::variance() const {
  double body_sum = 0.0;
  double tail_sum = 0.0;
  for (std::size_t i = 0; i + 1 < kCells; ++i) body_sum += meanSquare(body[i], body[i + 1]);
  for (std::size_t i = 0; i < kCells; ++i) tail_sum += meanSquare(tail[i], tail[i + 1]);
  return (body_sum + tail_sum / kCells) / kCells;
}

const Random::NormalTable& Random::normalTable() {
  static const NormalTable table;
  return table;
}

Random::Random(std::uint64_t seed, Stream stream) : table_(&normalTable()) {
  std::uint64_t state = streamSeed(seed, stream);
  for (std::uint64_t& word : state_) word = splitMix(state);
}

}  // namespace tunnel_pilot::simulation
