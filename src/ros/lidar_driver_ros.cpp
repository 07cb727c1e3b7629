#include "tunnel_pilot/ros/lidar_driver_ros.h"

#include <ros/console.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>
#include <filesystem>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {
namespace {

using Refusal = drivers::LidarDriver::Refusal;

constexpr double kStanding = 0.05;  // [m/s]

void requireAbsolute(const std::string& file) {
  if (std::filesystem::path(file).is_absolute()) return;
  throw config::ConfigError("'network' = '" + file + "' must be the absolute path of a file");
}

}  // namespace

LidarDriverRos::LidarDriverRos(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : settings_(readSettings(private_nh)),
      driver_(makeDriver(settings_, settings_.parameters.network)),
      publisher_(nh.advertise<Proposal>("lidar_driver/proposal", 1)),
      diagnostics_(nh, private_nh, "lidar_driver", [this](auto& status) { fillStatus(status); }) {
  const auto hints = ros::TransportHints().tcpNoDelay();
  scan_subscriber_ = nh.subscribe("scan_filtered", 1, &LidarDriverRos::onScan, this, hints);
  odometry_subscriber_ = nh.subscribe("odom", 5, &LidarDriverRos::onOdometry, this, hints);
  joint_subscriber_ = nh.subscribe("joint_states", 5, &LidarDriverRos::onJointState, this, hints);
  status_subscriber_ = nh.subscribe("truck_status", 5, &LidarDriverRos::onTruckStatus, this, hints);
  load_service_ = private_nh.advertiseService("load_network", &LidarDriverRos::onLoadNetwork, this);
  ROS_INFO("lidar_driver: network %s", driver_.model().c_str());
}

LidarDriverRos::Settings LidarDriverRos::readSettings(const ros::NodeHandle& private_nh) {
  Parameters parameters(private_nh);
  const auto truck = takeTruck(parameters);
  return {drivers::loadLidarDriver(parameters.rest(), ""), truck.geometry};
}

drivers::LidarDriver LidarDriverRos::makeDriver(const Settings& settings, const std::string& file) {
  requireAbsolute(file);
  return {settings.parameters, settings.truck, neural::loadNetwork(file)};
}

void LidarDriverRos::onScan(const sensor_msgs::LaserScan& message) {
  if (clock_.jumped()) {
    ROS_WARN("lidar_driver: the clock jumped, starting anew");
    driver_.reset();
    motion_.reset();
  }
  const auto motion = motion_.motion();
  if (!motion) {
    problem_ = "no odometry or no articulation yet";
    ROS_WARN_THROTTLE(1.0, "lidar_driver: %s", problem_.c_str());
    return;
  }
  const auto scan = toCore(message);
  const auto proposal =
      driver_.propose(scan, *motion, nowAfter(toRos(std::max(motion->stamp, scan.stamp))));
  confidence_ = proposal.confidence;
  const bool refused = driver_.refusal() != Refusal::kNone;
  problem_ = refused ? "no valid proposal: " + toString(driver_.refusal()) : "";
  if (refused) ROS_WARN_THROTTLE(1.0, "lidar_driver: %s", problem_.c_str());
  auto answer = boost::make_shared<Proposal>(toRos(proposal));
  answer->outputs = driver_.outputs();
  if (const auto& code = driver_.code()) {
    answer->outputs_first = code->node(0);
    answer->outputs_spacing = code->node(1) - code->node(0);
  }
  answer->model = driver_.model();
  publisher_.publish(answer);
}

// What another network does, nobody knows before it is tried: not while the truck obeys.
std::string LidarDriverRos::whyNoOtherNetwork() const {
  if (truck_state_) {
    if (*truck_state_ == TruckStatus::STATE_STANDBY) return "";
    return "the truck is in " + toString(static_cast<bridge::SafetyState>(*truck_state_)) +
           ", networks are changed in STANDBY";
  }
  const auto motion = motion_.motion();
  return motion && !(std::abs(motion->speed) <= kStanding) ? "the truck moves" : "";
}

bool LidarDriverRos::onLoadNetwork(LoadNetwork::Request& request, LoadNetwork::Response& response) {
  std::string why = whyNoOtherNetwork();
  if (why.empty()) {
    try {
      driver_ = makeDriver(settings_, request.file);
    } catch (const std::exception& error) {
      why = error.what();
    }
  }
  response.success = why.empty();
  response.message = response.success ? driver_.model() : "refused: " + why;
  ROS_INFO("lidar_driver: load_network: %s", response.message.c_str());
  return true;
}

void LidarDriverRos::fillStatus(Diagnostics::Status& status) const {
  const bool dead = driver_.refusal() == Refusal::kGivenUp || driver_.refusal() == Refusal::kCorrupted;
  if (problem_.empty()) {
    status.summary(Diagnostics::Status::OK, "proposing");
  } else {
    status.summary(dead ? Diagnostics::Status::ERROR : Diagnostics::Status::WARN, problem_);
  }
  status.add("network", driver_.model());
  status.add("confidence", confidence_);
}

}  // namespace tunnel_pilot::shell
