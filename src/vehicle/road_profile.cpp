#include "tunnel_pilot/vehicle/road_profile.h"

#include <cmath>
#include <cstddef>
#include <random>

namespace tunnel_pilot::vehicle {
namespace {

constexpr std::size_t kCells = 32768;  // 1.6 km
constexpr double kSpacing = 0.05;      // [m], resolves ISO 8608's 2.83 cycles/m
constexpr double kReference = 0.1;     // n0 [1/m]

struct Place {
  std::size_t cell;
  double within;  // [m]
};

Place place(double s) {
  const double cells = s / kSpacing;
  const bool on_first_loop = cells >= 0.0 && cells < static_cast<double>(kCells);
  const double loops = on_first_loop ? 0.0 : std::floor(cells / static_cast<double>(kCells));
  const double wrapped = cells - loops * static_cast<double>(kCells);
  const auto whole = static_cast<std::int64_t>(wrapped);
  // Rounding may put a tiny negative `s` on the loop's very end, which is its start.
  const std::size_t cell = static_cast<std::size_t>(whole) % kCells;
  return {cell, (wrapped - static_cast<double>(whole)) * kSpacing};
}

}  // namespace

RoadProfile::RoadProfile(double roughness, std::uint64_t seed)
    : height_(kCells + 1, 0.0), integral_(kCells + 1, 0.0) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> increment(
      0.0, std::sqrt(2.0 * M_PI * M_PI * kReference * kReference * roughness * kSpacing));
  for (std::size_t i = 1; i <= kCells; ++i) height_[i] = height_[i - 1] + increment(engine);

  // Close the loop by taking away its rise, then its mean height.
  const double rise = height_[kCells] / kCells;
  double sum = 0.0;
  for (std::size_t i = 0; i <= kCells; ++i) height_[i] -= rise * static_cast<double>(i);
  for (std::size_t i = 0; i < kCells; ++i) sum += height_[i];
  for (double& height : height_) height -= sum / kCells;
  for (std::size_t i = 1; i <= kCells; ++i) {
    integral_[i] = integral_[i - 1] + 0.5 * kSpacing * (height_[i - 1] + height_[i]);
  }
}

double RoadProfile::period() const { return kCells * kSpacing; }

double RoadProfile::elevation(double s) const {
  const auto [cell, within] = place(s);
  return height_[cell] + (height_[cell + 1] - height_[cell]) * within / kSpacing;
}

double RoadProfile::integral(double s) const {
  const auto [cell, within] = place(s);
  const double slope = (height_[cell + 1] - height_[cell]) / kSpacing;
  return integral_[cell] + within * (height_[cell] + 0.5 * slope * within);
}

double RoadProfile::mean(double s, double length) const {
  return (integral(s + 0.5 * length) - integral(s - 0.5 * length)) / length;
}

}  // namespace tunnel_pilot::vehicle
