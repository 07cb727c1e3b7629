#pragma once

#include <cstddef>
#include <vector>

namespace tunnel_pilot::neural {

/// Codes a value as probabilities of grid values, and back. Node i stands for first + i * spacing, and
/// its target for a value v is exp(-((v - node) / spacing)^2 / width): the output code of ALVINN
/// (Pomerleau 1991), with the distance counted in spacings and the width c open (docs/neural.md).
///
/// Decoding is the least-squares fit of h * bell(v) to the outputs around the best place: with
/// A = sum P g and B = sum g^2, h = A / B, and v maximises the explained energy A^2 / B.
///
/// Throws std::invalid_argument for less than 3 or more than kMaxNodes nodes, a spacing that is not
/// positive, and a width outside of [0.5, 100].
class GaussianCode {
 public:
  static constexpr std::size_t kMaxNodes = 256;

  GaussianCode(std::size_t nodes, double first, double spacing, double width);

  struct Decoded {
    double value = 0.0;       ///< within the grid; 0 when there is nothing to fit
    double height = 0.0;      ///< of the fitted bell: about 1 when the network is sure [1]
    double residual = 0.0;    ///< RMS of all outputs against the fitted bell [1]
    int peaks = 0;            ///< separate bells: two mean a junction, none that the highest is too low
    double confidence = 0.0;  ///< 0..1 from height and share of the outputs' energy in the bell
  };

  std::size_t nodes() const { return nodes_; }
  double node(std::size_t i) const { return first_ + static_cast<double>(i) * spacing_; }

  void encode(double value, double* targets) const;
  /// Takes any numbers; with a non-finite one the confidence is 0 and there is no peak. Allocates
  /// nothing.
  Decoded decode(const float* outputs) const;
  Decoded decode(const double* outputs) const;
  /// The decoded value, and its derivatives by the outputs, exact for a fit inside of the grid; all zero
  /// where the value is held at the grid's end or there is nothing to fit. For training through the
  /// code. (Half-way between nodes the fit's window moves on by one: noisy outputs make a step of about
  /// a thousandth of a spacing there, which the derivatives do not tell.)
  double decode(const double* outputs, double* derivatives) const;

 private:
  struct Best {
    std::size_t node = 0;
    double height = 0.0;
  };
  struct Fit {
    std::size_t best = 0;  ///< node
    double place = 0.0;    ///< of the bell, in spacings from the first node
    double height = 0.0;
    bool inside = false;  ///< a true maximum, not the grid's end
  };
  struct Sums {
    double a = 0.0, a1 = 0.0, a2 = 0.0;  ///< A and its derivatives by the bell's place
    double b = 0.0, b1 = 0.0, b2 = 0.0;  ///< B and its own
    double slope() const { return 2.0 * a1 * b - a * b1; }
    double slopeDerivative() const { return 2.0 * a2 * b + a1 * b1 - a * b2; }
  };

  template <typename Number>
  Decoded decodeAny(const Number* outputs) const;
  std::size_t windowBegin(std::size_t node) const { return node > reach_ ? node - reach_ : 0; }
  std::size_t windowEnd(std::size_t node) const;
  Best bestNode(const double* outputs) const;
  Sums sums(const double* outputs, std::size_t best, double place) const;
  Fit fit(const double* outputs) const;
  void subtract(double* outputs, std::size_t best, double place, double height) const;
  int countPeaks(const double* outputs, double* rest, const Fit& first) const;

  std::size_t nodes_;
  double first_, spacing_, width_;
  std::size_t reach_;           ///< nodes on either side that take part in a fit
  std::vector<double> bell_;    ///< by distance in nodes, 0..reach
  std::vector<double> energy_;  ///< of a bell at each node, as far as the grid reaches
};

}  // namespace tunnel_pilot::neural
