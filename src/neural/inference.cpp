#include "tunnel_pilot/neural/inference.h"

#include <algorithm>

#include "clones.h"
#include "vector_math.h"

namespace tunnel_pilot::neural {
namespace {

using namespace vector_math;

constexpr std::size_t kStrip = 16;         // inputs at a time of rows
constexpr std::size_t kRowBlock = 5;       // outputs at a time of rows
constexpr std::size_t kColumnBlock = 32;   // outputs at a time of columns
constexpr std::size_t kChannelBlock = 16;  // channels at a time of a convolution
constexpr std::size_t kColumnStep = 8;     // outputs or channels are laid out in multiples of it
constexpr std::size_t kPositionBlock = 4;  // positions at a time of a convolution
constexpr std::size_t kFewOutputs = 16;    // for which rows are quicker than columns
constexpr std::size_t kRoom = 64;          // behind buffers, for whole vectors and blocks

constexpr std::size_t roundUp(std::size_t count, std::size_t to) { return (count + to - 1) / to * to; }

// Sums of kRows outputs over all inputs, each with an accumulator for every lane of a strip. `w` moves
// on. `rest` is a strip of the inputs behind the last whole one, and zeros. The sums are stored as a
// vector, as which they are loaded next: a load of what several stores wrote would wait for them.
template <typename Floats, std::size_t kRows>
TUNNEL_PILOT_INLINE void rowBlock(const Layer& layer, const float*& w, const float* bias, const float* x,
                                  const float* rest, float* y) {
  constexpr std::size_t kVectors = kStrip / kLanes<Floats>;
  Floats sums[kRows][kVectors] = {};
  const auto strip = [&](const float* from) __attribute__((always_inline)) {
    for (std::size_t v = 0; v < kVectors; ++v) {
      Floats inputs;
      load(inputs, from + kLanes<Floats> * v);
      for (std::size_t r = 0; r < kRows; ++r) {
        addProduct(sums[r][v], w + kStrip * r + kLanes<Floats> * v, inputs);
      }
    }
    w += kStrip * kRows;
  };
  std::size_t k = 0;
  for (; k + kStrip <= layer.kernel; k += kStrip) strip(x + k);
  if (k < layer.kernel) strip(rest);
  Eight out = {};
  for (std::size_t r = 0; r < kRows; ++r) out[r] = bias[r] + sumStrip(sums[r]);
  store(y, out);
}

// For at least kStrip inputs. One or two outputs wait for their additions: shorter vectors, with two
// accumulators each, wait half as long.
template <typename Floats>
TUNNEL_PILOT_INLINE void rows(const Layer& layer, const float* w, const float* bias, const float* x,
                              float* y) {
  const std::size_t inputs = layer.kernel;
  float end[2 * kStrip] = {};  // the last strip of inputs, whole or not, with zeros behind
  std::copy_n(x + inputs - kStrip, kStrip, end);
  const float* const rest = end + kStrip - inputs % kStrip;
  std::size_t r = 0;
  for (; r + kRowBlock <= layer.channels_out; r += kRowBlock) {
    rowBlock<Floats, kRowBlock>(layer, w, bias + r, x, rest, y + r);
  }
  switch (layer.channels_out - r) {
    case 4:
      return rowBlock<Floats, 4>(layer, w, bias + r, x, rest, y + r);
    case 3:
      return rowBlock<Floats, 3>(layer, w, bias + r, x, rest, y + r);
    case 2:
      return rowBlock<Short<Floats>, 2>(layer, w, bias + r, x, rest, y + r);
    case 1:
      return rowBlock<Short<Floats>, 1>(layer, w, bias + r, x, rest, y + r);
    default:
      return;
  }
}

// Sums of kOutputs outputs, even and odd inputs apart. `w` moves on.
template <typename Floats, std::size_t kOutputs>
TUNNEL_PILOT_INLINE void columnBlock(const Layer& layer, const float*& w, const float* bias,
                                     const float* x, float* y) {
  constexpr std::size_t kWidth = kLanes<Floats>;
  constexpr std::size_t kVectors = kOutputs / kWidth;
  Floats even[kVectors];
  Floats odd[kVectors] = {};
  for (std::size_t v = 0; v < kVectors; ++v) load(even[v], bias + kWidth * v);
  std::size_t k = 0;
  for (; k + 2 <= layer.kernel; k += 2) {
    const float first = x[k];
    const float second = x[k + 1];
    for (std::size_t v = 0; v < kVectors; ++v) {
      addProduct(even[v], w + kWidth * v, first);
      addProduct(odd[v], w + kOutputs + kWidth * v, second);
    }
    w += 2 * kOutputs;
  }
  if (k < layer.kernel) {
    const float last = x[k];
    for (std::size_t v = 0; v < kVectors; ++v) addProduct(even[v], w + kWidth * v, last);
    w += kOutputs;
  }
  for (std::size_t v = 0; v < kVectors; ++v) store(y + kWidth * v, even[v] + odd[v]);
}

template <typename Floats>
TUNNEL_PILOT_INLINE void columns(const Layer& layer, const float* w, const float* bias, const float* x,
                                 float* y) {
  std::size_t c = 0;
  for (; c + kColumnBlock <= layer.channels_out; c += kColumnBlock) {
    columnBlock<Floats, kColumnBlock>(layer, w, bias + c, x, y + c);
  }
  switch (roundUp(layer.channels_out - c, kColumnStep)) {
    case 32:
      return columnBlock<Floats, 32>(layer, w, bias + c, x, y + c);
    case 24:
      return columnBlock<Short<Floats>, 24>(layer, w, bias + c, x, y + c);
    case 16:
      return columnBlock<Floats, 16>(layer, w, bias + c, x, y + c);
    case 8:
      return columnBlock<Short<Floats>, 8>(layer, w, bias + c, x, y + c);
    default:
      return;
  }
}

// kChannels channels at kPositions positions; `x` is the first signal at the first of them, `y` the
// first channel's output there.
template <typename Floats, std::size_t kChannels, std::size_t kPositions>
TUNNEL_PILOT_INLINE void tile(const Layer& layer, std::size_t positions, std::size_t channels,
                              const float* w, const float* bias, const float* x, float* y) {
  constexpr std::size_t kWidth = kLanes<Floats>;
  constexpr std::size_t kVectors = kChannels / kWidth;
  Floats sums[kPositions][kVectors];
  for (std::size_t p = 0; p < kPositions; ++p) {
    for (std::size_t v = 0; v < kVectors; ++v) load(sums[p][v], bias + kWidth * v);
  }
  for (std::size_t i = 0; i < layer.channels_in; ++i, x += layer.length_in) {
    for (std::size_t k = 0; k < layer.kernel; ++k, w += kChannels) {
      for (std::size_t p = 0; p < kPositions; ++p) {
        const float value = x[p * layer.stride + k];
        for (std::size_t v = 0; v < kVectors; ++v) addProduct(sums[p][v], w + kWidth * v, value);
      }
    }
  }
  float out[kPositions][kChannels];
  for (std::size_t p = 0; p < kPositions; ++p) {
    for (std::size_t v = 0; v < kVectors; ++v) store(out[p] + kWidth * v, sums[p][v]);
  }
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t p = 0; p < kPositions; ++p) y[c * positions + p] = out[p][c];
  }
}

template <typename Floats, std::size_t kChannels>
TUNNEL_PILOT_INLINE void channelBlock(const Layer& layer, std::size_t channels, const float* w,
                                      const float* bias, const float* x, float* y) {
  const std::size_t positions = layer.lengthOut();
  std::size_t p = 0;
  for (; p + kPositionBlock <= positions; p += kPositionBlock) {
    tile<Floats, kChannels, kPositionBlock>(layer, positions, channels, w, bias, x + p * layer.stride,
                                            y + p);
  }
  for (; p < positions; ++p) {
    tile<Floats, kChannels, 1>(layer, positions, channels, w, bias, x + p * layer.stride, y + p);
  }
}

template <typename Floats>
TUNNEL_PILOT_INLINE void convolution(const Layer& layer, const float* w, const float* bias,
                                     const float* x, float* y) {
  const std::size_t a_block = layer.channels_in * layer.kernel * kChannelBlock;
  for (std::size_t c = 0; c < layer.channels_out; c += kChannelBlock, w += a_block) {
    const std::size_t channels = layer.channels_out - c;
    float* const out = y + c * layer.lengthOut();
    if (channels > kColumnStep) {
      channelBlock<Floats, kChannelBlock>(layer, channels < kChannelBlock ? channels : kChannelBlock, w,
                                          bias + c, x, out);
    } else {
      channelBlock<Short<Floats>, kColumnStep>(layer, channels, w, bias + c, x, out);
    }
  }
}

// Activation, and what is handed on.
template <typename Floats>
TUNNEL_PILOT_INLINE void finish(const Layer& layer, const float* x, float* y) {
  const std::size_t own = layer.outputs() - layer.passed;
  if (own > kLanes<Eight>) {
    activate<Floats>(layer.activation, y, own);
  } else {
    activate<Short<Floats>>(layer.activation, y, own);
  }
  for (std::size_t i = 0; i < layer.passed; ++i) y[own + i] = x[layer.channels_in * layer.length_in + i];
}

// One function for all: what it calls is compiled for the instructions of that which calls it.
template <typename Floats>
TUNNEL_PILOT_INLINE void runSteps(const Inference::Step* step, std::size_t count,
                                  const float* parameters, const float* x, float* y, float* next) {
  for (std::size_t i = 0; i < count; ++i, ++step) {
    const Layer& layer = step->layer;
    const float* const w = parameters + step->weights;
    const float* const bias = parameters + step->biases;
    switch (step->layout) {
      case Inference::Layout::kRows:
        rows<Floats>(layer, w, bias, x, y);
        break;
      case Inference::Layout::kColumns:
        columns<Floats>(layer, w, bias, x, y);
        break;
      case Inference::Layout::kConvolution:
        convolution<Floats>(layer, w, bias, x, y);
        break;
    }
    finish<Floats>(layer, x, y);
    x = y;
    float* const free = next;
    next = y;
    y = free;
  }
}

#if defined(__x86_64__)
__attribute__((target("avx512f,avx512vl"))) void runWithAvx512(const Inference::Step* step,
                                                               std::size_t count,
                                                               const float* parameters, const float* x,
                                                               float* y, float* next) {
  runSteps<Sixteen>(step, count, parameters, x, y, next);
}

__attribute__((target("avx2"))) void runWithAvx2(const Inference::Step* step, std::size_t count,
                                                 const float* parameters, const float* x, float* y,
                                                 float* next) {
  runSteps<Eight>(step, count, parameters, x, y, next);
}
#endif

void runAnywhere(const Inference::Step* step, std::size_t count, const float* parameters, const float* x,
                 float* y, float* next) {
  runSteps<Four>(step, count, parameters, x, y, next);
}

Inference::Layout layoutOf(const Layer& layer) {
  if (layer.lengthOut() > 1 || layer.channels_in > 1) return Inference::Layout::kConvolution;
  const bool few = layer.channels_out < kFewOutputs && layer.kernel >= kStrip;
  return few ? Inference::Layout::kRows : Inference::Layout::kColumns;
}

}  // namespace

std::vector<Inference::Kernel> Inference::kernels() {
  std::vector<Kernel> kernels;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) {
    kernels.push_back(runWithAvx512);
  }
  if (__builtin_cpu_supports("avx2")) kernels.push_back(runWithAvx2);
#endif
  kernels.push_back(runAnywhere);
  return kernels;
}

Inference::Inference(const Network& network)
    : kernel_(kernels().front()), inputs_(network.inputs()), outputs_(network.outputs()) {
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
    const std::size_t end = first + std::min(block, roundUp(layer.channels_out - first, kColumnStep));
    for (std::size_t k = 0; k < inputs; ++k) {
      for (std::size_t c = first; c < end; ++c) {
        const bool inside = c < layer.channels_out;
        parameters_.push_back(inside ? static_cast<float>(weights[c * inputs + k]) : 0.0F);
      }
    }
  }
}

void Inference::run(const float* input, float* output) {
  kernel_(steps_.data(), steps_.size(), parameters_.data(), input, front_.data(), back_.data());
  const Values& last = steps_.size() % 2 == 1 ? front_ : back_;
  std::copy_n(last.data(), outputs_, output);
}

}  // namespace tunnel_pilot::neural
