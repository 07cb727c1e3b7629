#include "tunnel_pilot/neural/inference.h"

#include <algorithm>

#include "clones.h"
#include "vector_math.h"

namespace tunnel_pilot::neural {
namespace {

using namespace vector_math;

constexpr std::size_t kStrip = 2 * kWidth;  // inputs at a time of rows
constexpr std::size_t kRowBlock = 5;        // outputs at a time of rows
constexpr std::size_t kColumnBlock = 32;    // outputs at a time of columns
constexpr std::size_t kChannelBlock = 16;   // channels at a time of a convolution
constexpr std::size_t kPositionBlock = 4;   // positions at a time of a convolution
constexpr std::size_t kFewOutputs = 16;     // for which rows are quicker than columns
constexpr std::size_t kRoom = 64;           // behind buffers, for whole vectors and blocks

constexpr std::size_t roundUp(std::size_t count, std::size_t to) { return (count + to - 1) / to * to; }

// Sums of kRows outputs over all inputs: two accumulators each, of even and odd vectors. `w` moves on.
template <std::size_t kRows>
TUNNEL_PILOT_INLINE void rowBlock(const float*& w, const float* bias, const float* x, std::size_t count,
                                  float* y) {
  Floats even[kRows] = {};
  Floats odd[kRows] = {};
  const auto strip = [&](const float* from) __attribute__((always_inline)) {
    Floats first;
    Floats second;
    load(first, from);
    load(second, from + kWidth);
    for (std::size_t r = 0; r < kRows; ++r) {
      addProduct(even[r], w + kStrip * r, first);
      addProduct(odd[r], w + kStrip * r + kWidth, second);
    }
    w += kStrip * kRows;
  };
  const std::size_t whole = count / kStrip * kStrip;
  for (std::size_t k = 0; k < whole; k += kStrip) strip(x + k);
  if (whole < count) {
    float rest[kStrip] = {};
    for (std::size_t k = whole; k < count; ++k) rest[k - whole] = x[k];
    strip(rest);
  }
  for (std::size_t r = 0; r < kRows; ++r) {
    const Floats s = even[r] + odd[r];
    y[r] = bias[r] + (((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7])));
  }
}

TUNNEL_PILOT_INLINE void rows(const Layer& layer, const float* w, const float* bias, const float* x,
                              float* y) {
  const std::size_t inputs = layer.kernel;
  std::size_t r = 0;
  for (; r + kRowBlock <= layer.channels_out; r += kRowBlock)
    rowBlock<kRowBlock>(w, bias + r, x, inputs, y + r);
  switch (layer.channels_out - r) {
    case 4:
      return rowBlock<4>(w, bias + r, x, inputs, y + r);
    case 3:
      return rowBlock<3>(w, bias + r, x, inputs, y + r);
    case 2:
      return rowBlock<2>(w, bias + r, x, inputs, y + r);
    case 1:
      return rowBlock<1>(w, bias + r, x, inputs, y + r);
    default:
      return;
  }
}

// Sums of kVectors * 8 outputs, even and odd inputs apart. `w` moves on.
template <std::size_t kVectors>
TUNNEL_PILOT_INLINE void columnBlock(const float*& w, const float* bias, const float* x,
                                     std::size_t count, float* y) {
  Floats even[kVectors];
  Floats odd[kVectors] = {};
  for (std::size_t v = 0; v < kVectors; ++v) load(even[v], bias + kWidth * v);
  std::size_t k = 0;
  for (; k + 2 <= count; k += 2) {
    const Floats first = Floats{} + x[k];
    const Floats second = Floats{} + x[k + 1];
    for (std::size_t v = 0; v < kVectors; ++v) {
      addProduct(even[v], w + kWidth * v, first);
      addProduct(odd[v], w + kWidth * (kVectors + v), second);
    }
    w += 2 * kVectors * kWidth;
  }
  if (k < count) {
    const Floats last = Floats{} + x[k];
    for (std::size_t v = 0; v < kVectors; ++v) addProduct(even[v], w + kWidth * v, last);
    w += kVectors * kWidth;
  }
  for (std::size_t v = 0; v < kVectors; ++v) store(y + kWidth * v, even[v] + odd[v]);
}

TUNNEL_PILOT_INLINE void columns(const Layer& layer, const float* w, const float* bias, const float* x,
                                 float* y) {
  const std::size_t inputs = layer.kernel;
  std::size_t c = 0;
  for (; c + kColumnBlock <= layer.channels_out; c += kColumnBlock) {
    columnBlock<kColumnBlock / kWidth>(w, bias + c, x, inputs, y + c);
  }
  switch (roundUp(layer.channels_out - c, kWidth) / kWidth) {
    case 4:
      return columnBlock<4>(w, bias + c, x, inputs, y + c);
    case 3:
      return columnBlock<3>(w, bias + c, x, inputs, y + c);
    case 2:
      return columnBlock<2>(w, bias + c, x, inputs, y + c);
    case 1:
      return columnBlock<1>(w, bias + c, x, inputs, y + c);
    default:
      return;
  }
}

// kVectors * 8 channels at kPositions positions; `x` is the first signal at the first of them, `y` the
// first channel's output there.
template <std::size_t kVectors, std::size_t kPositions>
TUNNEL_PILOT_INLINE void tile(const Layer& layer, std::size_t positions, std::size_t channels,
                              const float* w, const float* bias, const float* x, float* y) {
  Floats sums[kPositions][kVectors];
  for (std::size_t p = 0; p < kPositions; ++p) {
    for (std::size_t v = 0; v < kVectors; ++v) load(sums[p][v], bias + kWidth * v);
  }
  for (std::size_t i = 0; i < layer.channels_in; ++i, x += layer.length_in) {
    for (std::size_t k = 0; k < layer.kernel; ++k, w += kVectors * kWidth) {
      for (std::size_t p = 0; p < kPositions; ++p) {
        const Floats value = Floats{} + x[p * layer.stride + k];
        for (std::size_t v = 0; v < kVectors; ++v) addProduct(sums[p][v], w + kWidth * v, value);
      }
    }
  }
  float out[kPositions][kVectors * kWidth];
  for (std::size_t p = 0; p < kPositions; ++p) {
    for (std::size_t v = 0; v < kVectors; ++v) store(out[p] + kWidth * v, sums[p][v]);
  }
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t p = 0; p < kPositions; ++p) y[c * positions + p] = out[p][c];
  }
}

template <std::size_t kVectors>
TUNNEL_PILOT_INLINE void channelBlock(const Layer& layer, std::size_t channels, const float* w,
                                      const float* bias, const float* x, float* y) {
  const std::size_t positions = layer.lengthOut();
  std::size_t p = 0;
  for (; p + kPositionBlock <= positions; p += kPositionBlock) {
    tile<kVectors, kPositionBlock>(layer, positions, channels, w, bias, x + p * layer.stride, y + p);
  }
  for (; p < positions; ++p) {
    tile<kVectors, 1>(layer, positions, channels, w, bias, x + p * layer.stride, y + p);
  }
}

TUNNEL_PILOT_INLINE void convolution(const Layer& layer, const float* w, const float* bias,
                                     const float* x, float* y) {
  const std::size_t a_block = layer.channels_in * layer.kernel * kChannelBlock;
  for (std::size_t c = 0; c < layer.channels_out; c += kChannelBlock, w += a_block) {
    const std::size_t channels = layer.channels_out - c;
    float* const out = y + c * layer.lengthOut();
    if (channels > kWidth) {
      channelBlock<2>(layer, channels < kChannelBlock ? channels : kChannelBlock, w, bias + c, x, out);
    } else {
      channelBlock<1>(layer, channels, w, bias + c, x, out);
    }
  }
}

// Activation, and what is handed on.
TUNNEL_PILOT_INLINE void finish(const Layer& layer, const float* x, float* y) {
  const std::size_t own = layer.outputs() - layer.passed;
  activate(layer.activation, y, own);
  for (std::size_t i = 0; i < layer.passed; ++i) y[own + i] = x[layer.channels_in * layer.length_in + i];
}

// One function for all, since which of its variants suits the machine is looked up at every call.
TUNNEL_PILOT_CLONES void runSteps(const Inference::Step* step, std::size_t count,
                                  const float* parameters, const float* x, float* y, float* next) {
  for (std::size_t i = 0; i < count; ++i, ++step) {
    const Layer& layer = step->layer;
    const float* const w = parameters + step->weights;
    const float* const bias = parameters + step->biases;
    switch (step->layout) {
      case Inference::Layout::kRows:
        rows(layer, w, bias, x, y);
        break;
      case Inference::Layout::kColumns:
        columns(layer, w, bias, x, y);
        break;
      case Inference::Layout::kConvolution:
        convolution(layer, w, bias, x, y);
        break;
    }
    finish(layer, x, y);
    x = y;
    float* const free = next;
    next = y;
    y = free;
  }
}

Inference::Layout layoutOf(const Layer& layer) {
  if (layer.lengthOut() > 1 || layer.channels_in > 1) return Inference::Layout::kConvolution;
  const bool few = layer.channels_out < kFewOutputs && layer.kernel >= kStrip;
  return few ? Inference::Layout::kRows : Inference::Layout::kColumns;
}

}  // namespace

Inference::Inference(const Network& network) : inputs_(network.inputs()), outputs_(network.outputs()) {
  const double* parameters = network.parameters().data();
  std::size_t width = 0;
  for (const Layer& layer : network.layers()) {
    lay(layer, parameters);
    parameters += layer.parameters();
    width = std::max(width, layer.outputs());
  }
  front_.assign(width + kRoom, 0.0F);
  back_.assign(width + kRoom, 0.0F);
}

void Inference::lay(const Layer& layer, const double* parameters) {
  Step step{layer, layoutOf(layer), parameters_.size(), 0};
  if (step.layout == Layout::kRows) {
    layRows(layer, parameters);
  } else {
    layColumns(layer, parameters, step.layout == Layout::kColumns ? kColumnBlock : kChannelBlock);
  }
  step.biases = parameters_.size();
  for (std::size_t c = 0; c < layer.channels_out; ++c) {
    parameters_.push_back(static_cast<float>(parameters[layer.weights() + c]));
  }
  parameters_.resize(roundUp(parameters_.size(), kStrip), 0.0F);
  steps_.push_back(step);
}

// [block of rows][strip of inputs][row of the block][input of the strip]
void Inference::layRows(const Layer& layer, const double* weights) {
  for (std::size_t first = 0; first < layer.channels_out; first += kRowBlock) {
    const std::size_t end = std::min(first + kRowBlock, layer.channels_out);
    for (std::size_t strip = 0; strip < layer.kernel; strip += kStrip) {
      for (std::size_t r = first; r < end; ++r) {
        for (std::size_t k = strip; k < strip + kStrip; ++k) {
          const bool inside = k < layer.kernel;
          parameters_.push_back(inside ? static_cast<float>(weights[r * layer.kernel + k]) : 0.0F);
        }
      }
    }
  }
}

// [block of outputs][input][output of the block, to whole vectors]
void Inference::layColumns(const Layer& layer, const double* weights, std::size_t block) {
  const std::size_t inputs = layer.channels_in * layer.kernel;
  for (std::size_t first = 0; first < layer.channels_out; first += block) {
    const std::size_t end = first + std::min(block, roundUp(layer.channels_out - first, kWidth));
    for (std::size_t k = 0; k < inputs; ++k) {
      for (std::size_t c = first; c < end; ++c) {
        const bool inside = c < layer.channels_out;
        parameters_.push_back(inside ? static_cast<float>(weights[c * inputs + k]) : 0.0F);
      }
    }
  }
}

void Inference::run(const float* input, float* output) {
  runSteps(steps_.data(), steps_.size(), parameters_.data(), input, front_.data(), back_.data());
  const Values& last = steps_.size() % 2 == 1 ? front_ : back_;
  std::copy_n(last.data(), outputs_, output);
}

}  // namespace tunnel_pilot::neural
