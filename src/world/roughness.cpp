#include <algorithm>
#include <cmath>

#include "tunnel.h"

namespace tunnel_pilot::world {

Draws::Draws(std::uint64_t seed, std::uint64_t stream)
    : engine_((seed + 1) * 0x9E3779B97F4A7C15ull ^ stream * 0xD1B54A32D192ED03ull) {}

double Draws::uniform(double min, double max) {
  const double unit = static_cast<double>(engine_() >> 11) * 0x1p-53;
  return min + (max - min) * unit;
}

// Box and Muller (1958); the second number of the pair is not kept, so that draws do not depend on
// history.
double Draws::gaussian() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(0.0, 1.0)));
  return radius * std::cos(uniform(0.0, 2.0 * M_PI));
}

// White noise on a grid, smoothed with the kernel exp(-2 (d / l)^2): its autocorrelation is then
// exp(-(d / l)^2). Between grid points, an eighth of l apart, linear interpolation loses under 0.5 %.
std::vector<double> roughnessAlong(const std::vector<double>& s, double length, bool closed,
                                   const Roughness& roughness, Draws& draws) {
  const double wanted_step = roughness.correlation_length / 8.0;
  const auto cells = std::max<std::ptrdiff_t>(1, std::llround(length / wanted_step));
  const double step = length / static_cast<double>(cells);
  const auto reach = static_cast<std::ptrdiff_t>(std::ceil(1.5 * roughness.correlation_length / step));
  std::vector<double> noise(static_cast<std::size_t>(cells + 2 * reach + 1));
  for (double& value : noise) value = draws.gaussian();
  const auto noiseAt = [&](std::ptrdiff_t i) {
    return noise[static_cast<std::size_t>(closed ? ((i % cells) + cells) % cells : i + reach)];
  };
  std::vector<double> kernel;
  double energy = 0.0;
  for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
    const double d = static_cast<double>(k) * step / roughness.correlation_length;
    kernel.push_back(std::exp(-2.0 * d * d));
    energy += kernel.back() * kernel.back();
  }
  std::vector<double> grid(static_cast<std::size_t>(cells) + 1);
  for (std::ptrdiff_t i = 0; i <= cells; ++i) {
    double sum = 0.0;
    for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
      sum += kernel[static_cast<std::size_t>(k + reach)] * noiseAt(i + k);
    }
    grid[static_cast<std::size_t>(i)] = roughness.sigma * sum / std::sqrt(energy);
  }
  std::vector<double> offsets;
  offsets.reserve(s.size());
  for (const double at : s) {
    const double position = std::clamp(at / step, 0.0, static_cast<double>(cells));
    const auto i = std::min<std::size_t>(static_cast<std::size_t>(position), grid.size() - 2);
    const double t = position - static_cast<double>(i);
    offsets.push_back(grid[i] + t * (grid[i + 1] - grid[i]));
  }
  return offsets;
}

}  // namespace tunnel_pilot::world
