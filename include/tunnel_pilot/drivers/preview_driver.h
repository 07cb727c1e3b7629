#pragma once

#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/path_predictor.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/drivers/preview_planner.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// Drives along the measured centerline as a driver does who looks ahead (optimal preview). Each scan it
/// finds where the truck will be beside the path when a new command acts (PathPredictor), plans the
/// command's rate over the horizon (PreviewPlanner) and commands its first moment.
/// Invalid proposals: no valid or fresh tunnel, no motion, non-finite input. Never throws, allocates
/// nothing after construction.
class PreviewDriver : public PathDriver {
 public:
  PreviewDriver(const PreviewDriverParameters& parameters, const vehicle::TruckGeometry& geometry);

  Proposal propose(const perception::Tunnel& tunnel, const Motion& motion, Stamp now) override;
  void reset() override;

  YawResponse learned() const { return predictor_.learned(); }

 private:
  PreviewDriverParameters parameters_;
  PathPredictor predictor_;
  PreviewPlanner planner_;
};

}  // namespace tunnel_pilot::drivers
