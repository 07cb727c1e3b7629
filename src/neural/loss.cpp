#include "tunnel_pilot/neural/loss.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunnel_pilot::neural {
namespace {

constexpr double kEdge = 1e-12;

// p log(p / q), which goes to 0 with p.
double divergence(double p, double q) { return p > 0.0 ? p * std::log(p / q) : 0.0; }

}  // namespace

double halfSquaredError(const double* outputs, const double* targets, std::size_t count,
                        double* gradient) {
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    gradient[i] = outputs[i] - targets[i];
    sum += 0.5 * gradient[i] * gradient[i];
  }
  return sum;
}

double crossEntropy(const double* outputs, const double* targets, std::size_t count, double* gradient) {
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = targets[i];
    if (!(outputs[i] >= 0.0 && outputs[i] <= 1.0)) sum = std::numeric_limits<double>::quiet_NaN();
    const double y = std::clamp(outputs[i], kEdge, 1.0 - kEdge);
    sum += divergence(t, y) + divergence(1.0 - t, 1.0 - y);
    gradient[i] = (y - t) / (y * (1.0 - y));
  }
  return sum;
}

}  // namespace tunnel_pilot::neural
