#include "tunnel_pilot/neural/gaussian_code.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace tunnel_pilot::neural {
namespace {

constexpr double kReach = 2.5;        // of a fit, in the bell's standard deviations
constexpr double kSeparate = 3.0;     // distance of separate bells, likewise
constexpr double kLowest = 0.15;      // height of what counts as a bell
constexpr double kSecondShare = 0.4;  // of the highest bell's height
constexpr double kValley = 0.75;      // between separate bells, of the lower one's output
constexpr int kMaxPeaks = 4;
constexpr int kMaxSteps = 20;
constexpr double kTolerance = 1e-12;  // of the bell's place, in spacings

using Values = std::array<double, GaussianCode::kMaxNodes>;

bool isFinite(const double* values, std::size_t count) {
  return std::all_of(values, values + count, [](double v) { return std::isfinite(v); });
}

}  // namespace

GaussianCode::GaussianCode(std::size_t nodes, double first, double spacing, double width)
    : nodes_(nodes), first_(first), spacing_(spacing), width_(width), reach_(0) {
  if (nodes < 3 || nodes > kMaxNodes) throw std::invalid_argument("a Gaussian code has 3 to 256 nodes");
  if (!std::isfinite(first)) throw std::invalid_argument("a Gaussian code's first value is finite");
  if (!std::isfinite(spacing) || spacing <= 0.0) {
    throw std::invalid_argument("a Gaussian code's spacing is positive");
  }
  if (!(width >= 0.5 && width <= 100.0)) {
    throw std::invalid_argument("a Gaussian code's width is within [0.5, 100]");
  }
  reach_ = std::min(static_cast<std::size_t>(std::ceil(kReach * std::sqrt(0.5 * width))), nodes - 1);
  for (std::size_t d = 0; d <= reach_; ++d) {
    bell_.push_back(std::exp(-static_cast<double>(d * d) / width));
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    double energy = 0.0;
    for (std::size_t j = windowBegin(i); j < windowEnd(i); ++j) {
      const double g = bell_[j > i ? j - i : i - j];
      energy += g * g;
    }
    energy_.push_back(energy);
  }
}

std::size_t GaussianCode::windowEnd(std::size_t node) const {
  return std::min(node + reach_ + 1, nodes_);
}

void GaussianCode::encode(double value, double* targets) const {
  for (std::size_t i = 0; i < nodes_; ++i) {
    const double distance = (value - node(i)) / spacing_;
    targets[i] = std::exp(-distance * distance / width_);
  }
}

// The node where a bell explains most, and its height there; unlike the highest output the node is
// hardly moved by noise. Offset after offset, all nodes at once: that is what makes vector instructions.
GaussianCode::Best GaussianCode::bestNode(const double* outputs) const {
  Values sums{};
  for (std::size_t d = 0; d <= reach_; ++d) {
    const double g = bell_[d];
    for (std::size_t i = 0; i + d < nodes_; ++i) sums[i] += g * outputs[i + d];
    for (std::size_t i = d; d > 0 && i < nodes_; ++i) sums[i] += g * outputs[i - d];
  }
  Best best;
  double most = 0.0;
  for (std::size_t i = 0; i < nodes_; ++i) {
    const double height = sums[i] / energy_[i];
    const double explained = height * sums[i];
    if (sums[i] > 0.0 && explained > most) {
      most = explained;
      best = {i, height};
    }
  }
  return best;
}

GaussianCode::Sums GaussianCode::sums(const double* outputs, std::size_t best, double place) const {
  Sums s;
  double d = static_cast<double>(windowBegin(best)) - place;
  // The bell's ratio from node to node is a geometric series: three exponentials do for all.
  double g = std::exp(-d * d / width_);
  double ratio = std::exp(-(2.0 * d + 1.0) / width_);
  const double ratio_of_ratios = std::exp(-2.0 / width_);
  for (std::size_t j = windowBegin(best); j < windowEnd(best); ++j) {
    const double slope = 2.0 * d / width_;  // of log g
    const double g1 = slope * g;
    const double g2 = (slope * slope - 2.0 / width_) * g;
    s.a += outputs[j] * g;
    s.a1 += outputs[j] * g1;
    s.a2 += outputs[j] * g2;
    s.b += g * g;
    s.b1 += 2.0 * g * g1;
    s.b2 += 2.0 * (g1 * g1 + g * g2);
    d += 1.0;
    g *= ratio;
    ratio *= ratio_of_ratios;
  }
  return s;
}

// Newton's method on the slope of A^2 / B, kept within a bracket of one node to either side.
GaussianCode::Fit GaussianCode::fit(const double* outputs) const {
  Fit result;
  result.best = bestNode(outputs).node;
  const auto at = static_cast<double>(result.best);
  double low = std::max(at - 1.0, 0.0);
  double high = std::min(at + 1.0, static_cast<double>(nodes_ - 1));
  result.place = at;
  Sums s = sums(outputs, result.best, at);
  for (int step = 0; step < kMaxSteps; ++step) {
    const double slope = s.slope();
    (slope > 0.0 ? low : high) = result.place;
    const double curvature = s.slopeDerivative();
    double next = result.place - slope / curvature;
    // Outside of the bracket its end is tried first: there the value is held when the slope leads on.
    if (!(curvature < 0.0)) next = 0.5 * (low + high);
    next = std::clamp(next, low, high);
    const double moved = std::abs(next - result.place);
    result.place = next;
    s = sums(outputs, result.best, next);
    if (moved <= kTolerance) break;
  }
  result.height = s.a / s.b;
  result.inside = s.a > 0.0 && s.slopeDerivative() < 0.0 &&
                  std::abs(s.slope()) <= 1e-9 * std::abs(s.slopeDerivative());
  return result;
}

void GaussianCode::subtract(double* outputs, std::size_t best, double place, double height) const {
  const double step = std::exp(-2.0 / width_);
  const double d = static_cast<double>(best) - place;
  const double middle = height * std::exp(-d * d / width_);
  double g = middle;
  double ratio = std::exp(-(2.0 * d + 1.0) / width_);
  for (std::size_t j = best; j < nodes_; ++j, g *= ratio, ratio *= step) outputs[j] -= g;
  ratio = std::exp((2.0 * d - 1.0) / width_);
  g = middle * ratio;
  for (std::size_t j = best; j-- > 0; g *= ratio) {
    outputs[j] -= g;
    ratio *= step;
  }
}

// `rest` is what the first bell leaves; another one counts if it is high enough, far enough from the
// others, and behind a valley of the outputs.
int GaussianCode::countPeaks(const double* outputs, double* rest, const Fit& first) const {
  if (first.height < kLowest) return 0;
  std::array<std::size_t, kMaxPeaks> found = {first.best};
  int count = 1;
  const double apart = kSeparate * std::sqrt(0.5 * width_);
  for (int tries = 0; tries < kMaxPeaks && count < kMaxPeaks; ++tries) {
    const auto [node, height] = bestNode(rest);
    if (height < std::max(kLowest, kSecondShare * first.height)) break;
    const bool separate =
        std::all_of(found.begin(), found.begin() + count, [&, next = node](std::size_t other) {
          const auto [left, right] = std::minmax(other, next);
          const double valley = *std::min_element(outputs + left, outputs + right + 1);
          return static_cast<double>(right - left) >= apart &&
                 valley < kValley * std::min(outputs[left], outputs[right]);
        });
    if (separate) found[static_cast<std::size_t>(count++)] = node;
    subtract(rest, node, static_cast<double>(node), height);
  }
  return count;
}

template <typename Number>
GaussianCode::Decoded GaussianCode::decodeAny(const Number* outputs) const {
  Values values{};
  std::copy_n(outputs, nodes_, values.begin());
  Decoded decoded;
  if (!isFinite(values.data(), nodes_)) return decoded;
  const Fit bell = fit(values.data());
  double energy = 0.0;
  for (std::size_t i = 0; i < nodes_; ++i) energy += values[i] * values[i];
  if (!(bell.height > 0.0) || !std::isfinite(energy)) return decoded;
  Values rest = values;
  subtract(rest.data(), bell.best, bell.place, bell.height);
  double left = 0.0;
  for (std::size_t i = 0; i < nodes_; ++i) left += rest[i] * rest[i];
  decoded.value = first_ + spacing_ * bell.place;
  decoded.height = bell.height;
  decoded.residual = std::sqrt(left / static_cast<double>(nodes_));
  decoded.peaks = countPeaks(values.data(), rest.data(), bell);
  // Two equal bells explain half of the energy: no confidence in either.
  const double explained = std::clamp(1.0 - 2.0 * left / energy, 0.0, 1.0);
  decoded.confidence = std::min(bell.height, 1.0 / bell.height) * explained;
  return decoded;
}

GaussianCode::Decoded GaussianCode::decode(const float* outputs) const { return decodeAny(outputs); }

GaussianCode::Decoded GaussianCode::decode(const double* outputs) const { return decodeAny(outputs); }

// The value is where slope() = 0, so that by the implicit function theorem
// d place / d P_j = -(d slope / d P_j) / slopeDerivative().
double GaussianCode::decode(const double* outputs, double* derivatives) const {
  std::fill_n(derivatives, nodes_, 0.0);
  if (!isFinite(outputs, nodes_)) return 0.0;
  const Fit bell = fit(outputs);
  if (!(bell.height > 0.0)) return 0.0;
  if (bell.inside) {
    const Sums s = sums(outputs, bell.best, bell.place);
    for (std::size_t j = windowBegin(bell.best); j < windowEnd(bell.best); ++j) {
      const double d = static_cast<double>(j) - bell.place;
      const double g = std::exp(-d * d / width_);
      derivatives[j] = -spacing_ * (4.0 * d / width_ * g * s.b - g * s.b1) / s.slopeDerivative();
    }
  }
  return first_ + spacing_ * bell.place;
}

}  // namespace tunnel_pilot::neural
