#pragma once

#include <cstdint>

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// A truck whose plant differs from the one its controllers know: each of these is multiplied by its own
/// factor, uniform in [1 - fraction, 1 + fraction] from `seed`:
///   masses (front, rear), inertias and CG height of both load states; cornering coefficient, relaxation
///   length, friction, yaw gain; dead time, dead band, flow limits (one factor for both), lag,
///   compliance frequency and damping; drive and brake limits and lags, rolling resistance; suspension
///   and tyre stiffness, damping; road roughness.
/// Not varied: what is measured with a tape on the real truck or set by law (lengths, CG offsets along
/// the truck, articulation stop, top speed), unsprung masses, and brake heating. The same seed and
/// fraction give the same truck. Throws std::invalid_argument unless 0 <= fraction < 0.5.
TruckParameters varied(const TruckParameters& truck, std::uint64_t seed, double fraction);

}  // namespace tunnel_pilot::vehicle
