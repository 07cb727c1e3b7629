#pragma once

#include <Eigen/Core>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/path_model.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

struct YawObserverParameters {
  double gain;                   ///< g of a truck not yet known [1]
  double gain_deviation;         ///< standard deviation of g among trucks, loads, floors [1]
  double disturbance_deviation;  ///< of d [1/m]
  double hinge_share;            ///< h [1]
  double memory;                 ///< after which a truck may have changed [s]
  double noise;                  ///< of the measured yaw rate against the model, a cycle [rad/s]
  double rate_noise;             ///< more of it per yaw rate that the articulation's rate gives [1]
  double least_speed;            ///< nothing is learned at a lower one [m/s]
};

/// Reads and checks a map `yaw_response`. Throws config::ConfigError.
YawObserverParameters loadYawObserver(config::Node node);

/// Learns gain g and disturbance d of
///   yaw rate = (g v sin(gamma) + h l_r gamma_dot) / (l_f cos(gamma) + l_r) + v d
/// from gyro, articulation and speed, with a two-state Kalman filter whose state returns to the prior
/// and whose uncertainty returns to the prior with the time `memory` (Ornstein-Uhlenbeck), so that it
/// never winds up where nothing is excited. h is known: of what the turning hinge gives by kinematics,
/// the tyres' slip takes a little away.
class YawObserver {
 public:
  YawObserver(const YawObserverParameters& parameters, const vehicle::TruckGeometry& geometry);

  /// `elapsed` [s] since the last motion. Takes finite motions only.
  void update(const Motion& motion, double elapsed);
  void reset();

  YawResponse response() const { return {parameters_.gain + state_[0], state_[1]}; }

 private:
  YawObserverParameters parameters_;
  vehicle::TruckGeometry geometry_;
  Eigen::Vector2d state_;  ///< (g - prior g, d)
  Eigen::Matrix2d covariance_;
};

}  // namespace tunnel_pilot::drivers
