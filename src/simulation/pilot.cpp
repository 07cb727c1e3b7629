#include "tunnel_pilot/simulation/pilot.h"

#include "tunnel_pilot/drivers/preview_laws.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr Stamp kDecisionPeriod = std::chrono::milliseconds(20);

}  // namespace

std::string toString(DriverChoice driver) {
  switch (driver) {
    case DriverChoice::kPreviewDriver:
      return "preview_driver";
    case DriverChoice::kLidarDriver:
      return "lidar_driver";
    case DriverChoice::kAll:
      return "all";
  }
  return "unknown";
}

std::vector<std::string> pilotFiles(const std::string& config_folder) {
  std::vector<std::string> files = perceptionFiles(config_folder);
  for (const char* stage : {"preview_driver", "lidar_driver", "arbiter", "can_bridge"}) {
    files.push_back(config_folder + "/" + stage + ".yaml");
  }
  return files;
}

PilotParameters loadPilot(const std::string& config_folder, std::optional<drivers::PreviewLaw> law) {
  const std::string folder = config_folder + "/";
  return {
      DriverChoice::kPreviewDriver,
      loadPerception(perceptionFiles(config_folder)),
      drivers::loadPreviewDriver(config::loadFile(folder + "preview_driver.yaml"), config_folder, law),
      drivers::loadLidarDriver(config::loadFile(folder + "lidar_driver.yaml"), config_folder),
      nullptr,
      supervision::loadArbiter(config::loadFile(folder + "arbiter.yaml")),
      bridge::loadBridge(config::loadFile(folder + "can_bridge.yaml"))};
}

Pilot::Pilot(const PilotParameters& parameters, const vehicle::TruckParameters& truck, can::Bus& bus)
    : sensor_in_base_{truck.geometry.lidar_x, truck.geometry.lidar_y, 0.0},
      perception_(parameters.perception),
      arbiter_(parameters.arbiter, truck),
      bridge_(parameters.bridge, truck.geometry, bus) {
  if (parameters.driver != DriverChoice::kLidarDriver) {
    preview_driver_ = drivers::makePreviewDriver(parameters.preview_driver, truck.geometry);
  }
  if (parameters.driver != DriverChoice::kPreviewDriver) {
    lidar_driver_.emplace(parameters.lidar_driver, truck.geometry, *parameters.network);
  }
}

void Pilot::takeScan(const geometry::Scan& scan, Stamp now) {
  takeMotion(now);
  const perception::Tunnel* tunnel =
      perception_.update(scan, sensor_in_base_, history_.poseAt(scan.stamp), now);
  if (tunnel == nullptr) {
    const bool frozen = perception_.filtered().rejection == perception::ScanFilter::Rejection::kFrozen;
    return arbiter_.setRejection({frozen}, now);
  }
  arbiter_.setPoints(perception_.filtered().points->points, scan.stamp, now);
  arbiter_.setWalls(perception_.walls(), now);
  tunnel_ = *tunnel;
  if (lidar_driver_) {
    lidar_proposal_ = lidar_driver_->propose(perception_.filtered().network_scan, bridge_.motion(), now);
    arbiter_.setProposal(supervision::Source::kLidarDriver, lidar_proposal_, now);
  }
  drive(now);
}

void Pilot::takeTunnel(const perception::Tunnel& tunnel, Stamp now) {
  takeMotion(now);
  arbiter_.setPoints(std::vector<pcl::PointXYZ>(), tunnel.state.stamp, now);
  tunnel_ = tunnel;
  drive(now);
}

void Pilot::drive(Stamp now) {
  arbiter_.setTunnel(tunnel_, now);
  if (preview_driver_) {
    preview_proposal_ = preview_driver_->propose(tunnel_, bridge_.motion(), now);
    arbiter_.setProposal(supervision::Source::kPreviewDriver, preview_proposal_, now);
  }
  decide(now);
}

void Pilot::tick(Stamp now) {
  takeMotion(now);
  if (now >= next_decision_) decide(now);
}

// The bridge reads the bus; what it learnt goes to those who need it.
void Pilot::takeMotion(Stamp now) {
  bridge_.tick(now);
  if (bridge_.motionFresh(now)) {
    history_.add(bridge_.motion(), now);
    arbiter_.setMotion(bridge_.motion(), now);
  }
  using State = bridge::SafetyState;
  const bridge::BridgeStatus& status = bridge_.status();
  const bool engaged = status.state == State::kActive || status.state == State::kDegraded;
  const bool stopping = status.state == State::kStopping || status.state == State::kStopped;
  arbiter_.setTruckState({engaged, stopping, status.reason}, now);
}

void Pilot::decide(Stamp now) {
  decision_ = arbiter_.decide(now);
  bridge_.setCommand(decision_.command, now);
  next_decision_ = now + kDecisionPeriod;
}

}  // namespace tunnel_pilot::simulation
