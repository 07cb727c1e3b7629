#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/drivers/steering_estimator.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/inference.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::drivers {

/// config/lidar_driver.yaml.
struct LidarDriverParameters {
  std::string network;  ///< file
  double speed;         ///< highest speed asked for [m/s]
  double max_scan_age;  ///< an older scan is not driven on [s]
  SteeringEstimatorParameters steering;
};

/// What a network may be told of the truck beside the scan.
struct TruckInputs {
  double articulation = 0.0;        ///< measured, freed of the sensor's bias [rad]
  double articulation_ahead = 0.0;  ///< when a command given now begins to act [rad]
  double speed = 0.0;               ///< [m/s]
  double yaw_gain = 1.0;            ///< g of YawObserver [1]
  double yaw_disturbance = 0.0;     ///< d of YawObserver [1/m]
};

/// Reads and checks config/lidar_driver.yaml; a relative file name is looked for from `folder`. Throws
/// config::ConfigError.
LidarDriverParameters loadLidarDriver(config::Node node, const std::string& folder);

/// The inputs of a network that steers by a scan, scaled as its file says. Gaps in the ranges are bridged
/// in 1/r, in which walls are straight lines.
class LidarInputs {
 public:
  static constexpr std::size_t kBeams = 761;

  /// Throws config::ConfigError for inputs that a lidar driver does not have.
  LidarInputs(const std::vector<neural::InputGroup>& groups, const std::string& source);

  std::size_t size() const { return size_; }
  /// Fills `inputs` (size() values). False when a number is not finite or the scan has other than kBeams
  /// ranges or none that is usable.
  bool fill(const std::vector<float>& ranges, const TruckInputs& truck, float* inputs);

 private:
  bool bridgeGaps(const std::vector<float>& ranges);

  std::vector<neural::InputGroup> groups_;
  std::size_t size_ = 0;
  std::vector<float> inverse_;  ///< 1/r of each beam, gaps bridged [1/m]
};

/// Steers by a network from the scan to the articulation (paper 000: 761-5-31 and its successors).
class LidarDriver {
 public:
  /// Throws config::ConfigError when the network's inputs or outputs are not those of a lidar driver.
  LidarDriver(const LidarDriverParameters& parameters, const vehicle::TruckGeometry& geometry,
              const neural::NetworkFile& network);

  /// `scan` is the filter's network scan, `motion` the newest feedback; both at or before `now`.
  Proposal propose(const geometry::Scan& scan, const Motion& motion, Stamp now);
  void reset();

  const std::vector<float>& outputs() const { return outputs_; }  ///< of the last scan
  const TruckInputs& truckInputs() const { return truck_; }       ///< at the last scan
  const std::string& model() const { return model_; }             ///< name and hash

 private:
  LidarDriverParameters parameters_;
  LidarInputs inputs_;
  neural::Inference inference_;
  neural::GaussianCode code_;
  SteeringEstimator steering_;
  TruckInputs truck_;
  std::string model_;
  std::vector<float> values_;
  std::vector<float> outputs_;
};

}  // namespace tunnel_pilot::drivers
