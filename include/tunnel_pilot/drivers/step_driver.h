#pragma once

#include <cstddef>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"

namespace tunnel_pilot::drivers {

/// All values of config/step_driver.yaml.
struct StepDriverParameters {
  double amplitude;  ///< of the large steps about the driver's own command [rad]
  double hold;       ///< mean time between two steps [s]
  double speed;      ///< highest speed asked for [m/s]
};

/// Throws config::ConfigError.
StepDriverParameters loadStepDriver(config::Node node);

/// Makes the steering show itself: adds steps to the articulation that another driver proposes, large
/// and small ones to both sides in turn, so that a record of the drive tells dead time, lag and, where
/// they are out of reach, the rate (vehicle::SteeringIdentification). The other driver keeps the truck
/// in the middle, and what is proposed goes the way of every proposal: envelope, limits and stops stay.
/// Never throws, allocates nothing.
class StepDriver {
 public:
  explicit StepDriver(const StepDriverParameters& parameters);

  /// Takes the other driver's newest proposal; an invalid one stays as it is.
  Proposal propose(const Proposal& base, Stamp now);

 private:
  StepDriverParameters parameters_;
  std::size_t step_ = 0;
  Stamp next_{};
  bool started_ = false;
};

}  // namespace tunnel_pilot::drivers
