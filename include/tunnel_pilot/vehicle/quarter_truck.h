#pragma once

#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::vehicle {

/// One axle's vertical motion about its static equilibrium (the quarter-truck, here for a whole axle):
///   m_s z_s'' = -k (z_s - z_u) - c (z_s' - z_u') - transfer
///   m_u z_u'' =  k (z_s - z_u) + c (z_s' - z_u') + k_t (road - z_u)
///   F_z = max(0, static load + k_t (road - z_u))
/// Heights [m], upward; forces [N]. Steps of at most 1 ms.
class QuarterTruck {
 public:
  /// `static_load` is the axle's weight on the road [N].
  QuarterTruck(const AxleSuspension& suspension, double static_load);

  /// At rest on a road of this height.
  void reset(double road);

  /// `transfer` is the load that driving, braking and grade add to this axle [N].
  void step(double road, double transfer, double dt);

  double bodyHeight() const { return body_; }
  double load() const { return load_; }  ///< F_z

 private:
  AxleSuspension suspension_;
  double static_load_;
  double sprung_mass_;
  double body_ = 0.0;
  double body_speed_ = 0.0;
  double wheel_ = 0.0;
  double wheel_speed_ = 0.0;
  double load_;
};

}  // namespace tunnel_pilot::vehicle
