#pragma once

#include "tunnel_pilot/vehicle/plant.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// Centre-articulated truck without slip (Corke & Ridley 2001; the paper's equation 2):
///   theta_dot = (v sin(gamma) + l_r gamma_dot) / (l_f cos(gamma) + l_r),
///   x_dot = v cos(theta), y_dot = v sin(theta)
/// The articulation follows its demand at no more than max_rate, up to the mechanical stop; the speed
/// integrates the demanded acceleration (less gravity on a grade), between 0 and max_speed. Friction and
/// roughness have no meaning here. Integrated by Simpson's rule (4th order).
class KinematicTruck : public Plant {
 public:
  explicit KinematicTruck(const TruckParameters& parameters);

  void reset(const geometry::Pose& pose, double articulation, double speed) override;
  void step(const PlantInput& input, const PlantSurroundings& surroundings, double dt) override;
  const PlantState& state() const override { return state_; }

 private:
  TruckGeometry geometry_;
  double max_rate_;
  double max_speed_;
  PlantState state_;
};

}  // namespace tunnel_pilot::vehicle
