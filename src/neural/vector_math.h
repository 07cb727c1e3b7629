#pragma once

// Eight floats side by side, and what Inference needs of them. Every operation is one IEEE operation a
// value, whatever instructions the machine has, so that results do not depend on it.

#include "clones.h"
#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural::vector_math {

constexpr std::size_t kWidth = 8;
using Floats = float __attribute__((vector_size(32)));
using Integers = int __attribute__((vector_size(32)));
using UnalignedFloats = float __attribute__((vector_size(32), aligned(4), may_alias));

TUNNEL_PILOT_INLINE void load(Floats& to, const float* from) {
  to = *reinterpret_cast<const UnalignedFloats*>(from);
}
TUNNEL_PILOT_INLINE void store(float* to, const Floats& from) {
  *reinterpret_cast<UnalignedFloats*>(to) = from;
}

// acc += w * x
TUNNEL_PILOT_INLINE void addProduct(Floats& acc, const float* w, const Floats& x) {
  acc += *reinterpret_cast<const UnalignedFloats*>(w) * x;
}

// exp(x), within 1.2e-7 of its value; x is held within +-87. The reduction to |r| <= ln 2 / 2 and the
// polynomial are those of Cephes' expf (Moshier). A NaN stays one.
TUNNEL_PILOT_INLINE void exponential(Floats& x) {
  x = x > 87.0F ? Floats{} + 87.0F : x;
  x = x < -87.0F ? Floats{} - 87.0F : x;
  constexpr float kRound = 12582912.0F;  // 1.5 * 2^23: adding it leaves no room for a fraction
  const Floats shifted = x * 1.44269504088896341F + kRound;
  const Floats n = shifted - kRound;
  const Floats r = (x - n * 0.693359375F) + n * 2.12194440e-4F;
  Floats p = r * 1.9875691500e-4F + 1.3981999507e-3F;
  p = p * r + 8.3334519073e-3F;
  p = p * r + 4.1665795894e-2F;
  p = p * r + 1.6666665459e-1F;
  p = p * r + 5.0000001201e-1F;
  p = p * (r * r) + r + 1.0F;
  // The low bits of `shifted` are n: moved up to the exponent they make 2^n.
  const Integers exponent = (reinterpret_cast<Integers>(shifted) << 23) + (127 << 23);
  x = p * reinterpret_cast<Floats>(exponent);
}

TUNNEL_PILOT_INLINE void sigmoid(Floats& x) {
  x = -x;
  exponential(x);
  x = 1.0F / (1.0F + x);
}

TUNNEL_PILOT_INLINE void tanh(Floats& x) {
  x = x + x;
  exponential(x);
  x = 1.0F - 2.0F / (1.0F + x);
}

/// `values` has room for whole vectors.
TUNNEL_PILOT_INLINE void activate(Activation activation, float* values, std::size_t count) {
  if (activation == Activation::kLinear) return;
  for (std::size_t i = 0; i < count; i += kWidth) {
    Floats x;
    load(x, values + i);
    if (activation == Activation::kSigmoid) {
      sigmoid(x);
    } else if (activation == Activation::kTanh) {
      tanh(x);
    } else {
      x = x < 0.0F ? Floats{} : x;
    }
    store(values + i, x);
  }
}

}  // namespace tunnel_pilot::neural::vector_math
