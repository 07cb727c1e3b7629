#include "tunnel_pilot/neural/diverged.h"

#include <cmath>

namespace tunnel_pilot::neural {

void requireFinite(const std::vector<double>& values, const std::string& what) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i] * values[i])) {
      throw Diverged("training diverged: " + what + " " + std::to_string(i + 1) + " of " +
                     std::to_string(values.size()) + " is " + std::to_string(values[i]));
    }
  }
}

}  // namespace tunnel_pilot::neural
