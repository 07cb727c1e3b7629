#include "tunnel_pilot/neural/delay_line.h"

#include <algorithm>
#include <stdexcept>

namespace tunnel_pilot::neural {

DelayLine::DelayLine(std::size_t signals, std::size_t delays) : signals_(signals) {
  if (signals == 0 || delays == 0) throw std::invalid_argument("a delay line needs signals and delays");
  values_.assign(signals * delays, 0.0);
}

void DelayLine::reset(const double* signals) {
  for (std::size_t begin = 0; begin < values_.size(); begin += signals_) {
    std::copy_n(signals, signals_, values_.begin() + static_cast<std::ptrdiff_t>(begin));
  }
}

void DelayLine::push(const double* signals) {
  newest_ = (newest_ == 0 ? values_.size() : newest_) - signals_;
  std::copy_n(signals, signals_, values_.begin() + static_cast<std::ptrdiff_t>(newest_));
}

template <typename Number>
void DelayLine::readAs(Number* inputs) const {
  for (std::size_t i = 0; i < values_.size(); ++i) {
    inputs[i] = static_cast<Number>(values_[(newest_ + i) % values_.size()]);
  }
}

template void DelayLine::readAs(double* inputs) const;
template void DelayLine::readAs(float* inputs) const;

}  // namespace tunnel_pilot::neural
