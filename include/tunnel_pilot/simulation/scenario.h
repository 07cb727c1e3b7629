#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::simulation {

enum class PlantModel { kKinematic, kDynamic };

struct PlantChoice {
  PlantModel model;
  vehicle::Load load;
  bool rough_road;   ///< class E
  double variation;  ///< plant parameters drawn from 1 +- this, unknown to the pilot [1]
};

/// The whole pilot drives through a world, in closed loop over CAN frames.
struct DriveExperiment {
  std::string world_file;
  bool both_directions;   ///< every seed once along the design line and once against it
  double station;         ///< start [m]
  double lateral_offset;  ///< start, left of the design line [m]
  double heading_error;   ///< start [rad]
  double rolling_speed;   ///< > 0: an operator drives straight up to the start pose at this speed, and
                          ///< hands over there; 0: start from standstill [m/s]
  double top_speed;       ///< no faster than this [m/s]
  double distance;        ///< ends after this; 0: one lap, or the line's end less the sight needed [m]
  double time_limit;      ///< [s]
  bool return_metrics;    ///< also judge it as a return to the centre
};

/// The plant alone, with a constant articulation demand and a speed held.
struct SteadyTurnExperiment {
  double articulation;  ///< demanded [rad]
  double speed;         ///< [m/s]
  double duration;      ///< [s]
  double settled;       ///< measured from here on [s]
  double angle;         ///< turn that is timed [rad]
};

/// The driver follows a designed path that it senses with noise; no walls, speed held.
struct LaneChangeExperiment {
  double speed;          ///< [m/s]
  double offset;         ///< b: the lanes lie this far apart [m]
  double change_length;  ///< one half-cosine takes this long, along the lane [m]
  std::vector<double>
      straights;  ///< before, between and after the changes [m]; 2 for a single change, 3 for a double
  double offset_sigma;   ///< noise of the sensed path, per scan [m]
  double heading_sigma;  ///< [rad]
};

/// The perception alone, against the truth, while a truck is led along the design line with a gentle
/// weave: what it is asked does not depend on what it answers.
struct PerceptionExperiment {
  std::string world_file;
  bool both_directions;
  double speed;         ///< [m/s]
  double weave_offset;  ///< amplitude of the weave [m]
  double weave_length;  ///< its wave length [m]
  double distance;      ///< 0: one lap, or to the line's end less the sight needed [m]
};

using Experiment =
    std::variant<DriveExperiment, SteadyTurnExperiment, LaneChangeExperiment, PerceptionExperiment>;

enum class Judge { kEverySeed, kMedian, kReportOnly };

/// What a metric must be. Values in SI units.
struct Goal {
  std::string metric;  ///< see metrics.h
  std::string paper;   ///< what the paper says, in its words; "-" where it says nothing
  Judge judge;
  std::optional<double> min;
  std::optional<double> max;

  bool holds(double value) const;  ///< false for NaN, true when there are no bounds
  /// How far `value` lies beyond the bounds, negative inside: larger is worse.
  double badness(double value) const;
};

/// One experiment with its seeds and goals, from one YAML file of scenarios/.
struct Scenario {
  std::string name;
  std::string title;
  std::string file;                                ///< it was read from
  std::string config_folder;                       ///< the rooms' YAML files
  std::optional<drivers::PreviewLaw> preview_law;  ///< none: what preview_driver.yaml says
  std::optional<can::ProfileKind> profile;         ///< of the bus; none: what the sides' files say
  std::uint64_t first_seed;
  int seeds;
  PlantChoice plant;
  Experiment experiment;
  std::vector<Goal> goals;
};

/// Reads a scenario; folders in it are relative to the file. Throws config::ConfigError naming file,
/// key, unit and range.
Scenario loadScenario(const std::string& file);

/// The lane-change path of an experiment, in the map frame from the origin along x: straights joined by
/// half-cosines y = b/2 (1 - cos(pi x / length)), alternately to the left and back. Its curvature steps
/// where they meet.
geometry::Path laneChangePath(const LaneChangeExperiment& experiment);

}  // namespace tunnel_pilot::simulation
