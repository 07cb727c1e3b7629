#pragma once

#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/supervision/speed_governor.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::simulation {

/// What bounds a drive along a line that is known without error.
struct IdealDrive {
  double station;       ///< start of the way on the line [m]
  double way;           ///< [m]
  double speed;         ///< at the start [m/s]
  double top_speed;     ///< [m/s]
  double acceleration;  ///< [m/s^2]
  double sight;         ///< length of the line seen ahead of the front axle [m]
};

/// Shortest time [s] for the way that the governor allows: at each place the lowest of the top speed,
/// the governor's limit along the true line, its stopping speed within the sight ahead of the nose, and
/// what the acceleration gave: v^2 grows by at most 2 a ds. Slowing down is as the governor asks, the
/// jerk is not limited. A closed line is driven on around; an open one bends on as at its end. The
/// line must not be empty, top_speed and acceleration must be positive.
double idealDriveTime(const geometry::Path& line, const IdealDrive& drive,
                      const supervision::SpeedGovernor& governor, const vehicle::TruckGeometry& truck);

}  // namespace tunnel_pilot::simulation
