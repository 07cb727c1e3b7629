#pragma once

#include <cstddef>
#include <vector>

namespace tunnel_pilot::neural {

/// The last values of some signals, as inputs of a network with tapped delays (NARX; Narendra &
/// Parthasarathy 1990): push() the signals of every step, then read() the network's inputs for the next,
///   [s1(k-1) .. sn(k-1), s1(k-2) .. sn(k-2), ...], the newest first.
///
/// Series-parallel use (training, one step ahead): push the measured output with the other signals.
/// Parallel use (simulation): push the network's own last output in its place.
///
/// Allocates nothing after construction. Throws std::invalid_argument for no signals or no delay.
class DelayLine {
 public:
  DelayLine(std::size_t signals, std::size_t delays);

  std::size_t size() const { return values_.size(); }  ///< inputs of the network
  /// As if these signals had stood for ever; reset to 0 at construction.
  void reset(const double* signals);
  void push(const double* signals);
  void read(double* inputs) const { readAs(inputs); }
  void read(float* inputs) const { readAs(inputs); }

 private:
  template <typename Number>
  void readAs(Number* inputs) const;

  std::size_t signals_;
  std::size_t newest_ = 0;  ///< begin of the newest in the ring
  std::vector<double> values_;
};

}  // namespace tunnel_pilot::neural
