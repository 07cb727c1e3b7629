#include "tunnel_pilot/vehicle/plant.h"

#include <cmath>
#include <stdexcept>

namespace tunnel_pilot::vehicle {

void checkStep(const PlantInput& input, const PlantSurroundings& surroundings, double dt) {
  const double numbers[] = {input.steering, input.acceleration, surroundings.grade,
                            surroundings.friction_scale};
  for (double number : numbers) {
    if (!std::isfinite(number)) throw std::invalid_argument("a plant's input must be finite");
  }
  if (!(dt > 0.0 && dt <= 0.01)) throw std::invalid_argument("a plant's step must be in (0, 0.01] s");
}

}  // namespace tunnel_pilot::vehicle
