#pragma once

#include <optional>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/preview_driver.h"
#include "tunnel_pilot/drivers/preview_planner.h"
#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::learning {

/// How a teacher judges (the map `teacher` of a recipe).
struct TeacherParameters {
  drivers::PreviewWeights weights{};
  double beyond = 0.0;  ///< what is far from the line it leads so far across it, not onto it [m]
};

/// Reads and checks such a map. Throws config::ConfigError.
TeacherParameters loadTeacher(config::Node node);

/// A truck beside a tunnel's design line.
struct TruckBesideLine {
  double station = 0.0;            ///< [m]
  double offset = 0.0;             ///< left of the line [m]
  double heading_error = 0.0;      ///< [rad]
  double articulation = 0.0;       ///< [rad]
  double articulation_rate = 0.0;  ///< [rad/s]
  double speed = 0.0;              ///< [m/s]
};

/// The better teacher: knows the design line and the truck's true state, and plans the optimal way on
/// (PreviewPlanner) until the plan no longer changes, from two starts, of which the cheaper end counts.
/// From kFar and more beside the line it plans to a line `beyond` on the other side, which fades to the
/// true one at kNear: a plan onto the line itself comes near it soon, but slowly onto it.
/// Its answer for a truck is the articulation that a driver should demand when its demand begins to act
/// on that truck.
class Teacher {
 public:
  static constexpr double kNear = 0.05;  ///< [m]
  static constexpr double kFar = 0.10;   ///< [m]

  Teacher(const TeacherParameters& judgement, const drivers::PreviewDriverParameters& driver,
          const vehicle::TruckGeometry& truck);

  /// The fastest that the articulation turns, from now on [rad/s].
  void setMaxRate(double rate);

  /// Articulation to demand [rad].
  double command(const geometry::Path& line, const TruckBesideLine& truck,
                 const drivers::YawResponse& believed);

  /// The truck moved on for `time` [s] along the line, its articulation going on at its rate.
  TruckBesideLine movedOn(const geometry::Path& line, const TruckBesideLine& truck,
                          const drivers::YawResponse& believed, double time) const;

  /// The truck moved on for `time` [s] with a constant demand `command` [rad] acting on it.
  TruckBesideLine steered(const geometry::Path& line, const TruckBesideLine& truck,
                          const drivers::YawResponse& believed, double command, double time) const;

 private:
  /// The demand of the plan that the planner's start comes to [rad].
  double settled(const drivers::PathState& start, const geometry::Path& line, double speed,
                 const drivers::YawResponse& believed);
  TruckBesideLine moved(const geometry::Path& line, const TruckBesideLine& truck,
                        const drivers::YawResponse& believed, double time,
                        const std::optional<double>& command) const;

  TeacherParameters judgement_;
  drivers::PreviewDriverParameters parameters_;
  drivers::TruckResponse response_;
  drivers::PreviewPlanner planner_;
};

}  // namespace tunnel_pilot::learning
