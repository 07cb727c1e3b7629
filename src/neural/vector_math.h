#pragma once

// Four, eight or sixteen floats side by side, and what Inference needs of them. Every operation is one
// IEEE operation a value, whatever instructions the machine has, so that results do not depend on it.
// Longer vectors than the machine's would be kept in memory.

#include <type_traits>

#include "clones.h"
#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural::vector_math {

using Four = float __attribute__((vector_size(16)));
using Eight = float __attribute__((vector_size(32)));
using Sixteen = float __attribute__((vector_size(64)));

template <typename Floats>
constexpr std::size_t kLanes = sizeof(Floats) / sizeof(float);

// For eight values, where Floats are the longest vectors.
template <typename Floats>
using Short = std::conditional_t<sizeof(Floats) < sizeof(Eight), Floats, Eight>;

// A vector anywhere among floats.
template <typename Floats>
struct __attribute__((packed, may_alias)) Unaligned {
  Floats value;
};

template <typename Floats>
TUNNEL_PILOT_INLINE void load(Floats& to, const float* from) {
  to = reinterpret_cast<const Unaligned<Floats>*>(from)->value;
}
template <typename Floats>
TUNNEL_PILOT_INLINE void store(float* to, const Floats& from) {
  reinterpret_cast<Unaligned<Floats>*>(to)->value = from;
}

// sum = first half of x + second half
template <typename Floats, typename Half>
TUNNEL_PILOT_INLINE void addHalves(const Floats& x, Half& sum) {
  Half halves[2];
  __builtin_memcpy(halves, &x, sizeof(Floats));
  sum = halves[0] + halves[1];
}

// The sum of sixteen lanes, in one order whether they are in four vectors, in two or in one.
TUNNEL_PILOT_INLINE float sumFour(const Four& s) { return (s[0] + s[1]) + (s[2] + s[3]); }
TUNNEL_PILOT_INLINE float sumEight(const Eight& lanes) {
  Four s;
  addHalves(lanes, s);
  return sumFour(s);
}
TUNNEL_PILOT_INLINE float sumStrip(const Four (&lanes)[4]) {
  return sumFour((lanes[0] + lanes[2]) + (lanes[1] + lanes[3]));
}
TUNNEL_PILOT_INLINE float sumStrip(const Eight (&lanes)[2]) { return sumEight(lanes[0] + lanes[1]); }
TUNNEL_PILOT_INLINE float sumStrip(const Sixteen (&lanes)[1]) {
  Eight s;
  addHalves(lanes[0], s);
  return sumEight(s);
}

// acc += w * x, where x is a vector or one value for all lanes. (A vector Floats{} + value would cost an
// addition, which makes 0 of -0.)
template <typename Floats, typename X>
TUNNEL_PILOT_INLINE void addProduct(Floats& acc, const float* w, const X& x) {
  acc += reinterpret_cast<const Unaligned<Floats>*>(w)->value * x;
}

// exp(x), within 1.2e-7 of its value; x is held within +-87. The reduction to |r| <= ln 2 / 2 and the
// polynomial are those of Cephes' expf (Moshier). A NaN stays one.
template <typename Floats>
TUNNEL_PILOT_INLINE void exponential(Floats& x) {
  // Both comparisons are of x, so that none waits for the other.
  const Floats not_below = x < -87.0F ? Floats{} - 87.0F : x;
  x = x > 87.0F ? Floats{} + 87.0F : not_below;
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
  using Integers = decltype(x < x);
  const Integers exponent = (reinterpret_cast<Integers>(shifted) << 23) + (127 << 23);
  x = p * reinterpret_cast<Floats>(exponent);
}

template <typename Floats>
TUNNEL_PILOT_INLINE void sigmoid(Floats& x) {
  x = -x;
  exponential(x);
  x = 1.0F / (1.0F + x);
}

template <typename Floats>
TUNNEL_PILOT_INLINE void tanh(Floats& x) {
  x = x + x;
  exponential(x);
  x = 1.0F - 2.0F / (1.0F + x);
}

/// `values` has room for whole vectors.
template <typename Floats>
TUNNEL_PILOT_INLINE void activate(Activation activation, float* values, std::size_t count) {
  if (activation == Activation::kLinear) return;
  for (std::size_t i = 0; i < count; i += kLanes<Floats>) {
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
