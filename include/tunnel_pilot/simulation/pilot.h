#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/simulation/perception_chain.h"
#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::simulation {

/// Which drivers propose.
enum class DriverChoice { kPreviewDriver, kLidarDriver, kAll };

std::string toString(DriverChoice driver);

/// The parameters of the pilot's stages, from the files of the config folder.
struct PilotParameters {
  DriverChoice driver = DriverChoice::kPreviewDriver;
  PerceptionParameters perception;
  drivers::PreviewDriverParameters preview_driver;
  drivers::LidarDriverParameters lidar_driver;
  std::shared_ptr<const neural::NetworkFile> network;  ///< the lidar driver's; none: it does not propose
  supervision::ArbiterParameters arbiter;
  bridge::BridgeParameters bridge;
};

/// The files that make up PilotParameters.
std::vector<std::string> pilotFiles(const std::string& config_folder);

/// A preview law given here takes the place of the folder's. Throws config::ConfigError.
PilotParameters loadPilot(const std::string& config_folder,
                          std::optional<drivers::PreviewLaw> law = std::nullopt);

/// The whole pilot without ROS: the same classes that the nodelets wrap, called in the order in which
/// their messages come. Deterministic: time is an argument, and the bus is given.
class Pilot {
 public:
  Pilot(const PilotParameters& parameters, const vehicle::TruckParameters& truck, can::Bus& bus);

  /// A scan was delivered: perception, driver, arbiter, bridge.
  void takeScan(const geometry::Scan& scan, Stamp now);

  /// A tunnel from elsewhere, in place of perception: driver, arbiter, bridge.
  void takeTunnel(const perception::Tunnel& tunnel, Stamp now);

  /// Runs the bridge and the arbiter's timer. Call it at kTickRate.
  void tick(Stamp now);
  static constexpr double kTickRate = 100.0;  ///< [Hz]

  bridge::CanBridge::Answer engage(Stamp now) { return bridge_.engage(now); }

  bridge::CanBridge& bridge() { return bridge_; }  ///< the operator's edges, heartbeats
  const bridge::CanBridge& bridge() const { return bridge_; }
  const supervision::Decision& decision() const { return decision_; }
  const perception::Tunnel& tunnel() const { return tunnel_; }
  const PerceptionChain& perception() const { return perception_; }
  const drivers::PathDriver* previewDriver() const { return preview_driver_.get(); }  ///< or none
  const drivers::Proposal& previewProposal() const { return preview_proposal_; }
  const drivers::Proposal& lidarProposal() const { return lidar_proposal_; }
  const std::optional<drivers::LidarDriver>& lidarDriver() const { return lidar_driver_; }

 private:
  void takeMotion(Stamp now);
  void drive(Stamp now);
  void decide(Stamp now);

  geometry::Pose sensor_in_base_;
  PerceptionChain perception_;
  std::unique_ptr<drivers::PathDriver> preview_driver_;
  std::optional<drivers::LidarDriver> lidar_driver_;
  supervision::Arbiter arbiter_;
  bridge::CanBridge bridge_;
  drivers::MotionHistory history_;
  perception::Tunnel tunnel_;
  drivers::Proposal preview_proposal_;
  drivers::Proposal lidar_proposal_;
  supervision::Decision decision_;
  Stamp next_decision_{};
};

}  // namespace tunnel_pilot::simulation
