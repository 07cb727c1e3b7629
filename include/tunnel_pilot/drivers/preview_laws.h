#pragma once

#include <memory>

#include "tunnel_pilot/drivers/neural_preview_driver.h"
#include "tunnel_pilot/drivers/preview_driver.h"

namespace tunnel_pilot::drivers {

/// The preview driver with the law that its parameters name. Throws config::ConfigError when its network
/// does not suit it.
inline std::unique_ptr<PathDriver> makePreviewDriver(const PreviewDriverParameters& parameters,
                                                     const vehicle::TruckGeometry& geometry) {
  if (parameters.law == PreviewLaw::kNetwork) {
    return std::make_unique<NeuralPreviewDriver>(parameters, geometry);
  }
  return std::make_unique<PreviewDriver>(parameters, geometry);
}

}  // namespace tunnel_pilot::drivers
