#include "tunnel_pilot/neural/batch_pass.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kLanes = BatchPass::kLanes;

#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TUNNEL_PILOT_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define TUNNEL_PILOT_CLONES
#endif

// y += sum over k of w[k] * row k of x. Four rows at a time, so that y stays in registers longer.
TUNNEL_PILOT_CLONES void addWeighted(double* __restrict y, const double* __restrict w,
                                     const double* __restrict x, std::size_t count) {
  std::size_t k = 0;
  for (; k + 4 <= count; k += 4) {
    const double* x0 = x + k * kLanes;
    for (std::size_t l = 0; l < kLanes; ++l) {
      y[l] += (w[k] * x0[l] + w[k + 1] * x0[kLanes + l]) +
              (w[k + 2] * x0[2 * kLanes + l] + w[k + 3] * x0[3 * kLanes + l]);
    }
  }
  for (; k < count; ++k) {
    for (std::size_t l = 0; l < kLanes; ++l) y[l] += w[k] * x[k * kLanes + l];
  }
}

// Row k of gx += w[k] * gy.
TUNNEL_PILOT_CLONES void spread(double* __restrict gx, const double* __restrict w,
                                const double* __restrict gy, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t l = 0; l < kLanes; ++l) gx[k * kLanes + l] += w[k] * gy[l];
  }
}

// gw[k] += gy . row k of x, summed in eight parts.
TUNNEL_PILOT_CLONES void correlate(double* __restrict gw, const double* __restrict gy,
                                   const double* __restrict x, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    const double* row = x + k * kLanes;
    double part[8] = {};
    for (std::size_t l = 0; l < kLanes; l += 8) {
      for (std::size_t j = 0; j < 8; ++j) part[j] += gy[l + j] * row[l + j];
    }
    gw[k] += ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7]));
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
    const double* weights = parameters + c * layer.channels_in * layer.kernel;
    for (std::size_t p = 0; p < positions; ++p) {
      double* out = y + (c * positions + p) * kLanes;
      std::fill_n(out, kLanes, bias[c]);
      for (std::size_t i = 0; i < layer.channels_in; ++i) {
        addWeighted(out, weights + i * layer.kernel,
                    x + (i * layer.length_in + p * layer.stride) * kLanes, layer.kernel);
      }
    }
  }
  const std::size_t own = layer.channels_out * positions * kLanes;
  activate(layer.activation, y, own);
  std::copy_n(x + layer.channels_in * layer.length_in * kLanes, layer.passed * kLanes, y + own);
}

void backwardLayer(const Layer& layer, const double* parameters, const double* x, const double* y,
                   double* gy, double* gx, double* parameter_gradient) {
  const std::size_t positions = layer.lengthOut();
  const std::size_t own = layer.channels_out * positions * kLanes;
  deactivate(layer.activation, y, gy, own);
  if (gx != nullptr) {
    std::fill_n(gx, layer.channels_in * layer.length_in * kLanes, 0.0);
    std::copy_n(gy + own, layer.passed * kLanes, gx + layer.channels_in * layer.length_in * kLanes);
  }
  double* bias_gradient = parameter_gradient + layer.weights();
  for (std::size_t c = 0; c < layer.channels_out; ++c) {
    const std::size_t first = c * layer.channels_in * layer.kernel;
    for (std::size_t p = 0; p < positions; ++p) {
      const double* out = gy + (c * positions + p) * kLanes;
      for (std::size_t l = 0; l < kLanes; ++l) bias_gradient[c] += out[l];
      for (std::size_t i = 0; i < layer.channels_in; ++i) {
        const std::size_t weight = first + i * layer.kernel;
        const std::size_t row = (i * layer.length_in + p * layer.stride) * kLanes;
        correlate(parameter_gradient + weight, out, x + row, layer.kernel);
        if (gx != nullptr) spread(gx + row, parameters + weight, out, layer.kernel);
      }
    }
  }
}

}  // namespace

BatchPass::BatchPass(const Network& network) : network_(&network) {
  values_.emplace_back(network.inputs() * kLanes, 0.0);
  gradients_.emplace_back(network.inputs() * kLanes, 0.0);
  for (const Layer& layer : network.layers()) {
    values_.emplace_back(layer.outputs() * kLanes, 0.0);
    gradients_.emplace_back(layer.outputs() * kLanes, 0.0);
  }
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
    double* gx = i > 0 || want_input_gradient ? gradients_[i].data() : nullptr;
    backwardLayer(layer, network_->parameters().data() + begin, values_[i].data(), values_[i + 1].data(),
                  gradients_[i + 1].data(), gx, parameter_gradient.data() + begin);
    end = begin;
  }
}

}  // namespace tunnel_pilot::neural
