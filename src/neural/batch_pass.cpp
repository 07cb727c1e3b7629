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

constexpr std::size_t kMostRows = 6;  // at a time: as many as there are registers for

// A matrix somewhere in memory: element (row, column) stands at row * row_step + column * column_step;
// its columns come in groups, `group_step` apart.
struct Matrix {
  const double* begin;
  std::size_t row_step;
  std::size_t column_step;
  std::size_t group_step;
};

// Rows of kLanes values, `step` apart, in groups likewise.
struct Lanes {
  const double* begin;
  std::size_t step;
  std::size_t group_step;
};

struct Columns {
  std::size_t count;
  std::size_t groups;
};

// kRows rows of y += the same rows of w times x, for eight lanes, one column after the other.
template <std::size_t kRows>
TUNNEL_PILOT_INLINE void multiplyTile(double* y, std::size_t y_step, const Matrix& w, const Lanes& x,
                                      const Columns& columns) {
  Doubles left[kRows];
  Doubles right[kRows];
  for (std::size_t r = 0; r < kRows; ++r) {
    left[r] = at(y + r * y_step);
    right[r] = at(y + r * y_step + kWidth);
  }
  for (std::size_t g = 0; g < columns.groups; ++g) {
    const double* weight = w.begin + g * w.group_step;
    const double* value = x.begin + g * x.group_step;
    for (std::size_t c = 0; c < columns.count; ++c, value += x.step, weight += w.column_step) {
      const Doubles x_left = at(value);
      const Doubles x_right = at(value + kWidth);
      for (std::size_t r = 0; r < kRows; ++r) {
        left[r] += weight[r * w.row_step] * x_left;
        right[r] += weight[r * w.row_step] * x_right;
      }
    }
  }
  for (std::size_t r = 0; r < kRows; ++r) {
    at(y + r * y_step) = left[r];
    at(y + r * y_step + kWidth) = right[r];
  }
}

template <std::size_t kRows>
TUNNEL_PILOT_INLINE void multiplyRows(double* y, std::size_t y_step, const Matrix& w, Lanes x,
                                      const Columns& columns) {
  for (std::size_t l = 0; l < kLanes; l += 2 * kWidth, x.begin += 2 * kWidth) {
    multiplyTile<kRows>(y + l, y_step, w, x, columns);
  }
}

// y += w x for `rows` rows of y, `y_step` apart, in blocks of about the same size.
TUNNEL_PILOT_CLONES void multiply(double* y, std::size_t y_step, std::size_t rows, Matrix w,
                                  const Lanes& x, const Columns& columns) {
  std::size_t blocks = (rows + kMostRows - 1) / kMostRows;
  for (std::size_t block = 0; rows > 0; rows -= block, --blocks) {
    block = (rows + blocks - 1) / blocks;
    switch (block) {
      case 6:
        multiplyRows<6>(y, y_step, w, x, columns);
        break;
      case 5:
        multiplyRows<5>(y, y_step, w, x, columns);
        break;
      case 4:
        multiplyRows<4>(y, y_step, w, x, columns);
        break;
      case 3:
        multiplyRows<3>(y, y_step, w, x, columns);
        break;
      case 2:
        multiplyRows<2>(y, y_step, w, x, columns);
        break;
      default:
        multiplyRows<1>(y, y_step, w, x, columns);
    }
    y += block * y_step;
    w.begin += block * w.row_step;
  }
}

// to[lane][row] = rows of lanes, `lane_step` from lane to lane.
void transpose(double* to, std::size_t lane_step, const double* rows, std::size_t count) {
  for (std::size_t r = 0; r < count; ++r) {
    for (std::size_t l = 0; l < kLanes; ++l) to[l * lane_step + r] = rows[r * kLanes + l];
  }
}

// Sums of g times x over positions and lanes, for kChannels channels and some weights of each, added to
// the first `count` of these.
template <std::size_t kChannels, std::size_t kVectors>
TUNNEL_PILOT_INLINE void correlateTile(double* gradient, std::size_t channel_step, std::size_t count,
                                       const double* g, std::size_t positions, const double* x,
                                       std::size_t lane_step, std::size_t stride) {
  Doubles sums[kChannels][kVectors] = {};
  for (std::size_t p = 0; p < positions; ++p, x += stride, g += kLanes) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      for (std::size_t v = 0; v < kVectors; ++v) {
        const Doubles value = at(x + l * lane_step + v * kWidth);
        for (std::size_t c = 0; c < kChannels; ++c) sums[c][v] += g[c * positions * kLanes + l] * value;
      }
    }
  }
  for (std::size_t c = 0; c < kChannels; ++c) {
    double flat[kVectors * kWidth];
    for (std::size_t v = 0; v < kVectors; ++v) at(flat + v * kWidth) = sums[c][v];
    for (std::size_t k = 0; k < count; ++k) gradient[c * channel_step + k] += flat[k];
  }
}

// The same for all channels.
template <std::size_t kVectors>
TUNNEL_PILOT_INLINE void correlateStrip(const Layer& layer, double* gradient, std::size_t count,
                                        const double* g, const double* x, std::size_t lane_step) {
  const std::size_t positions = layer.lengthOut();
  const std::size_t step = layer.channels_in * layer.kernel;
  std::size_t c = 0;
  for (; c + 4 <= layer.channels_out; c += 4) {
    correlateTile<4, kVectors>(gradient + c * step, step, count, g + c * positions * kLanes, positions,
                               x, lane_step, layer.stride);
  }
  for (; c < layer.channels_out; ++c) {
    correlateTile<1, kVectors>(gradient + c * step, step, count, g + c * positions * kLanes, positions,
                               x, lane_step, layer.stride);
  }
}

// Weights' gradient of a layer from that of its sums, and its transposed input. Twelve weights at a
// time, and what is left in the fewest vectors.
TUNNEL_PILOT_CLONES void correlate(const Layer& layer, double* gradient, const double* g,
                                   const double* x, std::size_t lane_step) {
  for (std::size_t i = 0; i < layer.channels_in; ++i, x += layer.length_in) {
    std::size_t count = 0;
    for (std::size_t k = 0; k < layer.kernel; k += count, gradient += count) {
      count = std::min(layer.kernel - k, 3 * kWidth);
      if (count > 2 * kWidth) {
        correlateStrip<3>(layer, gradient, count, g, x + k, lane_step);
      } else if (count > kWidth) {
        correlateStrip<2>(layer, gradient, count, g, x + k, lane_step);
      } else {
        correlateStrip<1>(layer, gradient, count, g, x + k, lane_step);
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
    const double* signals = x + p * layer.stride * kLanes;
    for (std::size_t k = 0; k < layer.kernel; k += kStrip) {
      multiply(y + p * kLanes, positions * kLanes, layer.channels_out,
               {parameters + k, row_step, 1, layer.kernel},
               {signals + k * kLanes, kLanes, layer.length_in * kLanes},
               {std::min(kStrip, layer.kernel - k), layer.channels_in});
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
      multiply(gx + (i * layer.length_in + p * layer.stride) * kLanes, kLanes, layer.kernel,
               {parameters + i * layer.kernel, 1, layer.channels_in * layer.kernel, 0},
               {gy + p * kLanes, positions * kLanes, 0}, {layer.channels_out, 1});
    }
  }
}

// In four sums, lest every addition wait for the one before.
void addBiasGradient(const Layer& layer, const double* gy, double* gradient) {
  const std::size_t count = layer.lengthOut() * kLanes;
  for (std::size_t c = 0; c < layer.channels_out; ++c, gy += count) {
    double sums[4] = {};
    for (std::size_t j = 0; j < count; j += 4) {
      for (std::size_t part = 0; part < 4; ++part) sums[part] += gy[j + part];
    }
    gradient[c] += (sums[0] + sums[2]) + (sums[1] + sums[3]);
  }
}

// From lane to lane of transposed rows, with room for a whole tile behind the last. Odd in cache lines,
// so that the lanes do not fight for the same place of the cache.
std::size_t laneStep(std::size_t rows) { return ((rows / 8 + 3) | 1U) * 8; }

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
