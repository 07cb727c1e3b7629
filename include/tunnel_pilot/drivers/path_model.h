#pragma once

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// State of the truck beside a path, as the steering's command will find it: command is the articulation
/// demand that acts now (the dead time has passed).
struct PathState {
  double s = 0.0;              ///< foot point on the path [m]
  double offset = 0.0;         ///< e_y, left of the path [m]
  double heading_error = 0.0;  ///< e_psi, body heading minus path direction [rad]
  double articulation = 0.0;   ///< gamma [rad]
  double command = 0.0;        ///< u [rad]
};

/// What the driver knows of the truck's answer to steering.
struct TruckResponse {
  vehicle::TruckGeometry geometry;
  double lag;               ///< of the articulation behind its command [s]
  double max_rate;          ///< of articulation and command [rad/s]
  double max_articulation;  ///< highest command [rad]
  double slip_compliance;   ///< tyre slip angle per lateral acceleration, 1/(g C) [rad s^2/m]
};

/// How the yaw rate was measured to answer, beside what the kinematics say.
struct YawResponse {
  double gain = 1.0;         ///< g, on the part that steady articulation gives [1]
  double disturbance = 0.0;  ///< d, sensor bias and slope of the road [1/m]
};

/// Beyond this the path-error form would divide by zero: the path's centre of curvature is reached.
inline double curvatureRoom(double curvature, double offset) {
  return std::max(0.2, 1.0 - curvature * offset);
}

/// Share of the command's distance that the articulation goes in one `step` [s], a first-order lag.
inline double lagShare(double step, double lag) { return 1.0 - std::exp(-step / lag); }

/// One step of the truck's exact kinematics beside a path, with the mean curvature of the path over the
/// step; the equations stand at PreviewPlanner. `cos_heading_error` is that of `now`, `share` the
/// lagShare() of `step`.
inline PathState advancedOnPath(const TruckResponse& truck, const PathState& now,
                                double cos_heading_error, double command_rate, double speed,
                                double curvature, const YawResponse& believed, double step,
                                double share) {
  const double most = truck.max_rate * step;
  const double turn_of_hinge =
      std::clamp(share * (now.command + 0.5 * command_rate * step - now.articulation), -most, most);
  const double middle = now.articulation + 0.5 * turn_of_hinge;
  const double travel = speed * step;
  const double arm =
      truck.geometry.front_axle_to_hinge * std::cos(middle) + truck.geometry.rear_axle_to_hinge;
  const double turn =
      (believed.gain * travel * std::sin(middle) + truck.geometry.rear_axle_to_hinge * turn_of_hinge) /
          arm +
      travel * believed.disturbance;
  const double slip = -truck.slip_compliance * speed * turn / step +
                      (believed.gain - 1.0) * std::sin(middle) / (1.0 + std::cos(middle));
  const double advance_on_path = travel * cos_heading_error / curvatureRoom(curvature, now.offset);
  const double error_growth = turn - curvature * advance_on_path;
  PathState next;
  next.s = now.s + advance_on_path;
  next.offset = now.offset + travel * std::sin(now.heading_error + 0.5 * error_growth + slip);
  next.heading_error = now.heading_error + error_growth;
  next.articulation = now.articulation + turn_of_hinge;
  next.command =
      std::clamp(now.command + command_rate * step, -truck.max_articulation, truck.max_articulation);
  return next;
}

}  // namespace tunnel_pilot::drivers
