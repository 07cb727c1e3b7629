#include "tunnel_pilot/vehicle/quarter_truck.h"

#include <algorithm>

namespace tunnel_pilot::vehicle {

QuarterTruck::QuarterTruck(const AxleSuspension& suspension, double static_load)
    : suspension_(suspension),
      static_load_(static_load),
      sprung_mass_(
          std::max(static_load / kGravity - suspension.unsprung_mass, suspension.unsprung_mass)),
      load_(static_load) {}

void QuarterTruck::reset(double road) {
  body_ = wheel_ = road;
  body_speed_ = wheel_speed_ = 0.0;
  load_ = static_load_;
}

void QuarterTruck::step(double road, double transfer, double dt) {
  const double spring =
      suspension_.stiffness * (body_ - wheel_) + suspension_.damping * (body_speed_ - wheel_speed_);
  load_ = std::max(0.0, static_load_ + suspension_.tyre_stiffness * (road - wheel_));
  body_speed_ += dt * (-transfer - spring) / sprung_mass_;
  wheel_speed_ += dt * (spring + load_ - static_load_) / suspension_.unsprung_mass;
  body_ += dt * body_speed_;
  wheel_ += dt * wheel_speed_;
}

}  // namespace tunnel_pilot::vehicle
