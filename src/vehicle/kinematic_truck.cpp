#include "tunnel_pilot/vehicle/kinematic_truck.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::vehicle {

KinematicTruck::KinematicTruck(const TruckParameters& parameters)
    : geometry_(parameters.geometry),
      max_rate_(parameters.steering.max_rate),
      max_speed_(parameters.drive.max_speed) {}

void KinematicTruck::reset(const geometry::Pose& pose, double articulation, double speed) {
  state_ = PlantState{};
  state_.pose = pose;
  state_.articulation =
      std::clamp(articulation, -geometry_.max_articulation, geometry_.max_articulation);
  state_.speed = speed;
  state_.yaw_rate = yawRate(geometry_, speed, state_.articulation, 0.0);
  state_.lateral_acceleration = speed * state_.yaw_rate;
}

void KinematicTruck::step(const PlantInput& input, const PlantSurroundings& surroundings, double dt) {
  checkStep(input, surroundings, dt);
  const double demand =
      std::clamp(input.steering, -geometry_.max_articulation, geometry_.max_articulation);
  const double rate = std::clamp((demand - state_.articulation) / dt, -max_rate_, max_rate_);
  const double wanted = input.acceleration - kGravity * std::sin(surroundings.grade);
  const double end_speed = std::clamp(state_.speed + wanted * dt, 0.0, max_speed_);
  const double acceleration = (end_speed - state_.speed) / dt;

  // Articulation and speed are linear within the step and the heading's slope depends on them alone, so
  // Simpson's rule integrates first the heading, then the position.
  const auto slope = [&](double t) {
    return yawRate(geometry_, state_.speed + acceleration * t, state_.articulation + rate * t, rate);
  };
  const double start = slope(0.0);
  const double middle = slope(0.5 * dt);
  const double end = slope(dt);
  const double heading = state_.pose.heading;
  const double middle_heading = heading + dt * (5.0 * start + 8.0 * middle - end) / 24.0;
  const double end_heading = heading + dt * (start + 4.0 * middle + end) / 6.0;
  const double middle_speed = state_.speed + 0.5 * acceleration * dt;
  state_.pose.x += dt / 6.0 *
                   (state_.speed * std::cos(heading) + 4.0 * middle_speed * std::cos(middle_heading) +
                    end_speed * std::cos(end_heading));
  state_.pose.y += dt / 6.0 *
                   (state_.speed * std::sin(heading) + 4.0 * middle_speed * std::sin(middle_heading) +
                    end_speed * std::sin(end_heading));
  state_.pose.heading = geometry::wrapAngle(end_heading);

  state_.articulation += rate * dt;
  state_.articulation_rate = rate;
  state_.speed = end_speed;
  state_.acceleration = acceleration;
  state_.yaw_rate = yawRate(geometry_, state_.speed, state_.articulation, rate);
  state_.lateral_acceleration = state_.speed * state_.yaw_rate;
}

}  // namespace tunnel_pilot::vehicle
