#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural {

/// Fast forward pass of one input, in single precision, within 1e-6 of the double-precision BatchPass
/// for outputs of magnitude 1. Keeps a copy of the parameters, laid out for vector instructions.
/// Allocates nothing after construction. Sums run in an order that the source fixes, so that results are
/// the same with every vector width. An input that is not finite makes outputs that are not.
/// Compiled once each for AVX-512, AVX2 and any machine; the constructor takes the machine's best.
///
/// One of three layouts a layer, all read from front to end:
///   rows         few outputs: weights of up to five outputs by turns, sixteen inputs at a time, so that
///                the input is read once for all of them;
///   columns      weights of up to 32 outputs for one input after the other;
///   convolution  the same of up to 16 channels, for four positions at a time.
class Inference {
 public:
  explicit Inference(const Network& network);

  std::size_t inputs() const { return inputs_; }
  std::size_t outputs() const { return outputs_; }

  /// `input` holds inputs() values, `output` has room for outputs(). Not for two threads at once.
  void run(const float* input, float* output);

  enum class Layout : std::uint8_t { kRows, kColumns, kConvolution };
  struct Step {
    Layer layer;
    Layout layout;
    std::size_t weights;  ///< begin in the parameters as laid out
    std::size_t biases;
  };

 private:
  friend struct InferenceAccess;  // tests that spoil parameters or choose the kernel

  // Vectors that begin at the begin of a cache line are loaded at once.
  template <typename T>
  struct Aligned {
    using value_type = T;
    static constexpr std::align_val_t kAlignment{64};
    Aligned() = default;
    template <typename U>
    explicit Aligned(const Aligned<U>& /*other*/) {}
    T* allocate(std::size_t count) {
      return static_cast<T*>(::operator new(count * sizeof(T), kAlignment));
    }
    void deallocate(T* memory, std::size_t /*count*/) { ::operator delete(memory, kAlignment); }
    friend bool operator==(const Aligned& /*a*/, const Aligned& /*b*/) { return true; }
    friend bool operator!=(const Aligned& /*a*/, const Aligned& /*b*/) { return false; }
  };
  using Values = std::vector<float, Aligned<float>>;

  using Kernel = void (*)(const Step* step, std::size_t count, const float* parameters, const float* x,
                          float* y, float* next);
  static std::vector<Kernel> kernels();  // those for this machine, the quickest first

  void lay(const Layer& layer, const double* parameters);
  void layRows(const Layer& layer, const double* weights);
  void layColumns(const Layer& layer, const double* weights, std::size_t block);

  Kernel kernel_;
  std::size_t inputs_, outputs_;
  std::vector<Step> steps_;
  Values parameters_;
  Values front_, back_;
};

}  // namespace tunnel_pilot::neural
