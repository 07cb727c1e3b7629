#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tunnel_pilot/drivers/driver.h"

namespace tunnel_pilot::learning {

/// One moment of a drive: what the driver saw, and the articulation it should demand.
struct Example {
  std::vector<float> ranges;  ///< the filter's network scan [m]
  float articulation = 0.0F;       ///< measured [rad]
  float articulation_rate = 0.0F;  ///< measured [rad/s]
  float speed = 0.0F;              ///< measured [m/s]
  float label = 0.0F;              ///< articulation to demand [rad]
  std::uint32_t tunnel = 0;        ///< it was driven in: examples of one tunnel stay together
};

using DataSet = std::vector<Example>;

}  // namespace tunnel_pilot::learning
