#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tunnel_pilot/drivers/lidar_driver.h"

namespace tunnel_pilot::learning {

/// One moment of a drive: what the driver saw, and the articulation it should demand.
struct Example {
  std::vector<float> ranges;        ///< the filter's network scan [m]
  float articulation = 0.0F;        ///< when the driver saw the scan [rad]
  float articulation_ahead = 0.0F;  ///< when a command given then begins to act [rad]
  float speed = 0.0F;               ///< measured [m/s]
  float yaw_gain = 1.0F;            ///< g [1]
  float yaw_disturbance = 0.0F;     ///< d [1/m]
  float steering_rate = 0.25F;      ///< the fastest the articulation turns [rad/s]
  float label = 0.0F;               ///< articulation to demand [rad]
  std::uint32_t tunnel = 0;         ///< it was driven in: examples of one tunnel stay together
};

inline drivers::TruckInputs truckInputsOf(const Example& example) {
  return {static_cast<double>(example.articulation),    static_cast<double>(example.articulation_ahead),
          static_cast<double>(example.speed),           static_cast<double>(example.yaw_gain),
          static_cast<double>(example.yaw_disturbance), static_cast<double>(example.steering_rate)};
}

using DataSet = std::vector<Example>;

/// Adds the examples of another set, whose tunnels are other ones and get numbers of their own.
void append(DataSet& to, DataSet other);

}  // namespace tunnel_pilot::learning
