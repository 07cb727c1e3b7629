#pragma once

#include <string>

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

inline std::string truckFile() { return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/truck.yaml"; }

/// The shipped truck.
inline TruckParameters shippedTruck() { return loadTruck(truckFile()); }

/// The shipped truck with its hinge in the middle, where a mistake that swaps l_f and l_r cannot be
/// seen.
inline TruckParameters symmetricTruck() {
  TruckParameters truck = shippedTruck();
  truck.geometry.front_axle_to_hinge = 2.56;
  truck.geometry.rear_axle_to_hinge = 2.56;
  return truck;
}

constexpr double kDegree = 0.017453292519943295;  ///< [rad]

}  // namespace tunnel_pilot::vehicle
