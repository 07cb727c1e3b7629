#include "tunnel_pilot/neural/batch_pass.h"

#include <algorithm>
#include <cmath>

#include "clones.h"

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kLanes = BatchPass::kLanes;
constexpr std::size_t kStrip =
    64;  // inputs at a time of a dense layer: their rows stay in the nearest cache

// Four values side by side; one IEEE operation a value, whatever instructions the machine has.
constexpr std::size_t kWidth = 4;
using Doubles = double __attribute__((vector_size(32)));
using UnalignedDoubles = double __attribute__((vector_size(32), aligned(8), may_alias));

TUNNEL_PILOT_INLINE const UnalignedDoubles& at(const double* values) {
  return *reinterpret_cast<const UnalignedDoubles*>(values);
}
TUNNEL_PILOT_INLINE UnalignedDoubles& at(double* values) {
  return *reinterpret_cast<UnalignedDoubles*>(values);
}

// A matrix somewhere in memory: element (row, column) stands at row * row_step + column * column_step.
struct Matrix {
  const double* begin;
  std::size_t row_step;
  std::size_t column_step;
};

// Rows of kLanes values, `step` apart.
template <typename Number>
struct Rows {
  Number* begin;
  std::size_t step;
};

// kRows rows of y += the same rows of w times x, for eight lanes, one column after the other.
template <std::size_t kRows>
TUNNEL_PILOT_INLINE void multiplyTile(double* y, std::size_t y_step, const double* w,
                                      const Matrix& matrix, const double* x, std::size_t x_step,
                                      std::size_t columns) {
  Doubles left[kRows];
  Doubles right[kRows];
  for (std::size_t r = 0; r < kRows; ++r) {
    left[r] = at(y + r * y_step);
    right[r] = at(y + r * y_step + kWidth);
  }
  for (std::size_t c = 0; c < columns; ++c, x += x_step, w += matrix.column_step) {
    const Doubles x_left = at(x);
    const Doubles x_right = at(x + kWidth);
    for (std::size_t r = 0; r < kRows; ++r) {
      left[r] += w[r * matrix.row_step] * x_left;
      right[r] += w[r * matrix.row_step] * x_right;
    }
  }
  for (std::size_t r = 0; r < kRows; ++r) {
    at(y + r * y_step) = left[r];
    at(y + r * y_step + kWidth) = right[r];
  }
}

template <std::size_t kRows>
TUNNEL_PILOT_INLINE void multiplyRows(double* y, std::size_t y_step, const double* w,
                                      const Matrix& matrix, const Rows<const double>& x,
                                      std::size_t columns) {
  for (std::size_t l = 0; l < kLanes; l += 2 * kWidth) {
    multiplyTile<kRows>(y + l, y_step, w, matrix, x.begin + l, x.step, columns);
  }
}

// y += w x for `rows` rows of y and `columns` rows of x.
TUNNEL_PILOT_CLONES void multiply(Rows<double> y, std::size_t rows, Matrix w, Rows<const double> x,
                                  std::size_t columns) {
  std::size_t r = 0;
  for (; r + 4 <= rows; r += 4) {
    multiplyRows<4>(y.begin + r * y.step, y.step, w.begin + r * w.row_step, w, x, columns);
  }
  for (; r < rows; ++r) {
    multiplyRows<1>(y.begin + r * y.step, y.step, w.begin + r * w.row_step, w, x, columns);
  }
}

// to[lane][row] = rows of lanes, `lane_step` from lane to lane.
void transpose(double* to, std::size_t lane_step, const double* rows, std::size_t count) {
  for (std::size_t r = 0; r < count; ++r) {
    for (std::size_t l = 0; l < kLanes; ++l) to[l * lane_step + r] = rows[r * kLanes + l];
  }
}

// Sums of g times x over positions and lanes, for kChannels channels and eight weights of each, added to
// the first `count` of these.
template <std::size_t kChannels>
TUNNEL_PILOT_INLINE void correlateTile(double* gradient, std::size_t channel_step, std::size_t count,
                                       const double* g, std::size_t positions, const double* x,
                                       std::size_t lane_step, std::size_t stride) {
  Doubles left[kChannels] = {};
  Doubles right[kChannels] = {};
  for (std::size_t p = 0; p < positions; ++p, x += stride, g += kLanes) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      const Doubles x_left = at(x + l * lane_step);
      const Doubles x_right = at(x + l * lane_step + kWidth);
      for (std::size_t c = 0; c < kChannels; ++c) {
        left[c] += g[c * positions * kLanes + l] * x_left;
        right[c] += g[c * positions * kLanes + l] * x_right;
      }
    }
  }
  for (std::size_t c = 0; c < kChannels; ++c) {
    double sums[2 * kWidth];
    at(sums) = left[c];
    at(sums + kWidth) = right[c];
    for (std::size_t k = 0; k < count; ++k) gradient[c * channel_step + k] += sums[k];
  }
}

// Weights' gradient of a layer from that of its sums, and its transposed input.
TUNNEL_PILOT_CLONES void correlate(const Layer& layer, double* gradient, const double* g,
                                   const double* x, std::size_t lane_step) {
  const std::size_t positions = layer.lengthOut();
  const std::size_t channel_step = layer.channels_in * layer.kernel;
  for (std::size_t i = 0; i < layer.channels_in; ++i) {
    for (std::size_t k = 0; k < layer.kernel; k += 2 * kWidth) {
      const std::size_t count = std::min(layer.kernel - k, 2 * kWidth);
      const double* const from = x + i * layer.length_in + k;
      double* const to = gradient + i * layer.kernel + k;
      std::size_t c = 0;
      for (; c + 4 <= layer.channels_out; c += 4) {
        correlateTile<4>(to + c * channel_step, channel_step, count, g + c * positions * kLanes,
                         positions, from, lane_step, layer.stride);
      }
      for (; c < layer.channels_out; ++c) {
        correlateTile<1>(to + c * channel_step, channel_step, count, g + c * positions * kLanes,
                         positions, from, lane_step, layer.stride);
      }
    }
  }
}

void activate(Activation activation, double* y, std::size_t count) {
  switch (activation) {
    case Activation::kLinear:
      break;
    case Activation::kTanh:
      for (std::size_t i = 0; i < count; ++i) y[i] = std::tanh(y[i]);
      break;
    case Activation::kSigmoid:
      for (std::size_t i = 0; i < count; ++i) y[i] = 1.0 / (1.0 + std::exp(-y[i]));
      break;
    case Activation::kRelu:
      for (std::size_t i = 0; i < count; ++i) y[i] = std::max(y[i], 0.0);
      break;
  }
}

// dE/d(sum) from dE/dy, in place; all derivatives follow from the output y.
void deactivate(Activation activation, const double* y, double* g, std::size_t count) {
  switch (activation) {
    case Activation::kLinear:
      break;
    case Activation::kTanh:
      for (std::size_t i = 0; i < count; ++i) g[i] *= 1.0 - y[i] * y[i];
      break;
    case Activation::kSigmoid:
      for (std::size_t i = 0; i < count; ++i) g[i] *= y[i] * (1.0 - y[i]);
      break;
    case Activation::kRelu:
      for (std::size_t i = 0; i < count; ++i) g[i] = y[i] > 0.0 ? g[i] : 0.0;
      break;
  }
}

void forwardLayer(const Layer& layer, const double* parameters, const double* x, double* y) {
  const double* bias = parameters + layer.weights();
  const std::size_t positions = layer.lengthOut();
  for (std::size_t c = 0; c < layer.channels_out; ++c) {
    std::fill_n(y + c * positions * kLanes, positions * kLanes, bias[c]);
  }
  const std::size_t row_step = layer.channels_in * layer.kernel;
  for (std::size_t p = 0; p < positions; ++p) {
    for (std::size_t i = 0; i < layer.channels_in; ++i) {
      const double* signal = x + (i * layer.length_in + p * layer.stride) * kLanes;
      for (std::size_t k = 0; k < layer.kernel; k += kStrip) {
        multiply({y + p * kLanes, positions * kLanes}, layer.channels_out,
                 {parameters + i * layer.kernel + k, row_step, 1}, {signal + k * kLanes, kLanes},
                 std::min(kStrip, layer.kernel - k));
      }
    }
  }
  const std::size_t own = layer.channels_out * positions * kLanes;
  activate(layer.activation, y, own);
  std::copy_n(x + layer.channels_in * layer.length_in * kLanes, layer.passed * kLanes, y + own);
}

// dE/dx from dE/d(sum): the transposed weights times it.
void spread(const Layer& layer, const double* parameters, const double* gy, double* gx) {
  const std::size_t positions = layer.lengthOut();
  const std::size_t own = layer.channels_out * positions * kLanes;
  const std::size_t signals = layer.channels_in * layer.length_in * kLanes;
  std::fill_n(gx, signals, 0.0);
  std::copy_n(gy + own, layer.passed * kLanes, gx + signals);
  for (std::size_t p = 0; p < positions; ++p) {
    for (std::size_t i = 0; i < layer.channels_in; ++i) {
      multiply({gx + (i * layer.length_in + p * layer.stride) * kLanes, kLanes}, layer.kernel,
               {parameters + i * layer.kernel, 1, layer.channels_in * layer.kernel},
               {gy + p * kLanes, positions * kLanes}, layer.channels_out);
    }
  }
}

void addBiasGradient(const Layer& layer, const double* gy, double* gradient) {
  const std::size_t count = layer.lengthOut() * kLanes;
  for (std::size_t c = 0; c < layer.channels_out; ++c) {
    for (std::size_t j = 0; j < count; ++j) gradient[c] += gy[c * count + j];
  }
}

// From lane to lane of transposed rows, with room for a whole tile behind the last. Odd in cache lines,
// so that the lanes do not fight for the same place of the cache.
std::size_t laneStep(std::size_t rows) { return ((rows / 8 + 2) | 1U) * 8; }

}  // namespace

BatchPass::BatchPass(const Network& network) : network_(&network) {
  std::size_t rows = 0;
  values_.emplace_back(network.inputs() * kLanes, 0.0);
  gradients_.emplace_back(network.inputs() * kLanes, 0.0);
  for (const Layer& layer : network.layers()) {
    values_.emplace_back(layer.outputs() * kLanes, 0.0);
    gradients_.emplace_back(layer.outputs() * kLanes, 0.0);
    rows = std::max(rows, layer.inputs());
  }
  transposed_.assign(kLanes * laneStep(rows), 0.0);
}

void BatchPass::forward() {
  const double* parameters = network_->parameters().data();
  for (std::size_t i = 0; i < network_->layers().size(); ++i) {
    const Layer& layer = network_->layers()[i];
    forwardLayer(layer, parameters, values_[i].data(), values_[i + 1].data());
    parameters += layer.parameters();
  }
}

void BatchPass::backward(std::vector<double>& parameter_gradient, bool want_input_gradient) {
  std::size_t end = network_->parameters().size();
  for (std::size_t i = network_->layers().size(); i-- > 0;) {
    const Layer& layer = network_->layers()[i];
    const std::size_t begin = end - layer.parameters();
    const double* parameters = network_->parameters().data() + begin;
    double* gradient = parameter_gradient.data() + begin;
    double* gy = gradients_[i + 1].data();
    deactivate(layer.activation, values_[i + 1].data(), gy, (layer.outputs() - layer.passed) * kLanes);
    addBiasGradient(layer, gy, gradient + layer.weights());
    const std::size_t signals = layer.channels_in * layer.length_in;
    transpose(transposed_.data(), laneStep(signals), values_[i].data(), signals);
    correlate(layer, gradient, gy, transposed_.data(), laneStep(signals));
    if (i > 0 || want_input_gradient) spread(layer, parameters, gy, gradients_[i].data());
    end = begin;
  }
}

}  // namespace tunnel_pilot::neural
