#pragma once

#include <cstddef>
#include <vector>

namespace tunnel_pilot::neural {

/// Codes a value as probabilities of grid values, and back. Node i stands for first + i * spacing, and
/// its target for a value v is exp(-((v - node) / spacing)^2 / width) (paper 000, equation 9, with the
/// distance counted in spacings; docs/neural.md).
class GaussianCode {
 public:
  GaussianCode(std::size_t nodes, double first, double spacing, double width);

  struct Decoded {
    double value = 0.0;
    double height = 0.0;      ///< of the fitted bell: about 1 when the network is sure [1]
    double residual = 0.0;    ///< RMS of the outputs against the fitted bell [1]
    int peaks = 0;            ///< separate bells: two mean a junction
    double confidence = 0.0;  ///< 0..1 from height, residual and peaks
  };

  std::size_t nodes() const { return nodes_; }
  double node(std::size_t i) const { return first_ + static_cast<double>(i) * spacing_; }

  void encode(double value, double* targets) const;
  /// Least-squares fit of the fixed-width bell, with free height, around the highest output. Takes any
  /// numbers; with a non-finite one the confidence is 0 and there is no peak. Allocates nothing.
  Decoded decode(const float* outputs) const;

 private:
  std::size_t nodes_;
  double first_, spacing_, width_;
};

}  // namespace tunnel_pilot::neural
