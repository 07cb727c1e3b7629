#include "tunnel_pilot/drivers/inverse_ranges.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tunnel_pilot::drivers {

bool invertRanges(const std::vector<float>& ranges, std::vector<float>& inverse) {
  const std::size_t beams = ranges.size();
  inverse.resize(beams);
  std::size_t last = beams;  // none yet
  for (std::size_t i = 0; i < beams; ++i) {
    if (!std::isfinite(ranges[i]) || ranges[i] <= 0.0F) continue;
    inverse[i] = 1.0F / ranges[i];
    if (last == beams) {
      std::fill_n(inverse.begin(), i, inverse[i]);
    } else if (i - last > 1) {
      const float step = (inverse[i] - inverse[last]) / static_cast<float>(i - last);
      for (std::size_t k = last + 1; k < i; ++k) {
        inverse[k] = inverse[last] + step * static_cast<float>(k - last);
      }
    }
    last = i;
  }
  if (last == beams) return false;
  std::fill(inverse.begin() + static_cast<std::ptrdiff_t>(last) + 1, inverse.end(), inverse[last]);
  return true;
}

}  // namespace tunnel_pilot::drivers
