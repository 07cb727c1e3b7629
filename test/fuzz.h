#pragma once

// What the fuzz programs share: numbers out of the fuzzer's bytes, and the end of a program whose
// promise was broken, which the fuzzer keeps as a finding.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <type_traits>

namespace tunnel_pilot {

/// Takes numbers from the front of the fuzzer's bytes; where they end, zeros. libFuzzer's own
/// FuzzedDataProvider knows no numbers that are not finite.
class FuzzBytes {
 public:
  FuzzBytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  bool empty() const { return size_ == 0; }

  void take(void* out, std::size_t size) {
    const std::size_t some = size < size_ ? size : size_;
    std::memset(out, 0, size);
    if (some > 0) std::memcpy(out, data_, some);
    data_ += some;
    size_ -= some;
  }

  template <class Number>
  Number take() {
    static_assert(std::is_arithmetic_v<Number> && !std::is_same_v<Number, bool>);
    Number number;
    take(&number, sizeof number);
    return number;
  }

  /// One of 0..count - 1.
  std::size_t choice(std::size_t count) { return take<std::uint8_t>() % count; }

  /// Between two numbers, in 65536 steps.
  double between(double min, double max) { return min + (max - min) * take<std::uint16_t>() / 65535.0; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

inline void require(bool kept, const char* promise) {
  if (kept) return;
  std::fprintf(stderr, "broken: %s\n", promise);
  std::abort();
}

}  // namespace tunnel_pilot
