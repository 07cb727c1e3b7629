#pragma once

#include "tunnel_pilot/geometry/pose.h"

namespace tunnel_pilot::vehicle {

/// What every plant takes: the paper's articulated trucks, the later car and model-car plants alike.
struct PlantInput {
  double steering = 0.0;      ///< demanded articulation (truck) or road-wheel angle (car) [rad]
  double acceleration = 0.0;  ///< demanded longitudinal acceleration, negative brakes [m/s^2]
};

/// The outside world acting on a plant.
struct PlantSurroundings {
  double grade = 0.0;           ///< slope angle along the heading, uphill positive [rad]
  double friction_scale = 1.0;  ///< times the tyre's mu [1]
};

/// What every plant tells. For a car, articulation is the road-wheel angle.
struct PlantState {
  geometry::Pose pose;                ///< reference point (front axle middle) and front body heading
  double articulation = 0.0;          ///< gamma = heading(front) - heading(rear) [rad]
  double articulation_rate = 0.0;     ///< [rad/s]
  double speed = 0.0;                 ///< along the front body at the reference point [m/s]
  double lateral_speed = 0.0;         ///< leftwards at the reference point [m/s] (slip)
  double yaw_rate = 0.0;              ///< of the front body [rad/s]
  double acceleration = 0.0;          ///< longitudinal, at the reference point [m/s^2]
  double lateral_acceleration = 0.0;  ///< at the reference point [m/s^2]
  double pitch = 0.0;                 ///< of the front body from the road, nose down positive [rad]
};

/// One interface for every vehicle model.
class Plant {
 public:
  virtual ~Plant() = default;

  /// Puts the vehicle at rest in all inner states but those given.
  virtual void reset(const geometry::Pose& pose, double articulation, double speed) = 0;

  /// Advances by `dt` [s], 0 < dt <= 0.01, under `input` held constant. Throws std::invalid_argument for
  /// another `dt` and for numbers that are not finite, before anything has changed.
  virtual void step(const PlantInput& input, const PlantSurroundings& surroundings, double dt) = 0;

  virtual const PlantState& state() const = 0;
};

/// The check that step() begins with, shared by all plants.
void checkStep(const PlantInput& input, const PlantSurroundings& surroundings, double dt);

}  // namespace tunnel_pilot::vehicle
