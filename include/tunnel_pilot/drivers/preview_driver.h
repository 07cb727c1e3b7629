#pragma once

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/path_predictor.h"
#include "tunnel_pilot/drivers/preview_planner.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// What the driver believes of the truck, and how it weighs errors (config/preview_driver.yaml).
struct PreviewDriverParameters {
  double speed;           ///< highest speed asked for [m/s]
  double planning_speed;  ///< lowest speed planned with, so that standing trucks may steer [m/s]
  double preview_time;    ///< of the point shown as preview point [s]
  double step;            ///< of the plan; the horizon has PreviewPlanner::kStages of them [s]
  PreviewWeights weights;
  PathPredictorParameters truck;
};

/// Reads and checks config/preview_driver.yaml. Throws config::ConfigError.
PreviewDriverParameters loadPreviewDriver(config::Node node);

/// Drives along the measured centerline as a driver does who looks ahead (optimal preview). Each scan it
/// finds where the truck will be beside the path when a new command acts (PathPredictor), plans the
/// command's rate over the horizon (PreviewPlanner) and commands its first moment.
/// Invalid proposals: no valid or fresh tunnel, no motion, non-finite input. Never throws, allocates
/// nothing after construction.
class PreviewDriver {
 public:
  PreviewDriver(const PreviewDriverParameters& parameters, const vehicle::TruckGeometry& geometry);

  /// `tunnel` is that of the newest scan, `motion` the newest feedback; both at or before `now`.
  Proposal propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now);
  void reset();

  YawResponse learned() const { return predictor_.learned(); }

 private:
  PreviewDriverParameters parameters_;
  PathPredictor predictor_;
  PreviewPlanner planner_;
};

}  // namespace tunnel_pilot::drivers
