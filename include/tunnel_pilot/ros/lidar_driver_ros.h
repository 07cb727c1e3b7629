#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/LoadNetwork.h>
#include <tunnel_pilot/TruckStatus.h>

#include <cstdint>
#include <optional>
#include <string>

#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/diagnostics.h"
#include "tunnel_pilot/ros/motion_input.h"

namespace tunnel_pilot::shell {

/// Shell of drivers::LidarDriver. Subscribes `scan_filtered`, `odom`, `joint_states`, `truck_status`;
/// publishes `lidar_driver/proposal` (tunnel_pilot/Proposal, with the network's outputs and name) for
/// every scan once the truck's motion is known. Service `~load_network` (tunnel_pilot/LoadNetwork)
/// changes the network, in STANDBY alone; a truck that tells no state must stand. Parameters:
/// config/lidar_driver.yaml, its `network` as an absolute path, and `truck_file` (path of the truck's
/// YAML). Throws config::ConfigError for them and for a network that is refused.
class LidarDriverRos {
 public:
  LidarDriverRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  struct Settings {
    drivers::LidarDriverParameters parameters;
    vehicle::TruckGeometry truck;
  };

  static Settings readSettings(const ros::NodeHandle& private_nh);
  static drivers::LidarDriver makeDriver(const Settings& settings, const std::string& file);
  void onScan(const sensor_msgs::LaserScan& message);
  void onOdometry(const nav_msgs::Odometry& message) { motion_.setOdometry(message); }
  void onJointState(const sensor_msgs::JointState& message) { motion_.setJointState(message); }
  void onTruckStatus(const TruckStatus& message) { truck_state_ = message.state; }
  bool onLoadNetwork(LoadNetwork::Request& request, LoadNetwork::Response& response);
  std::string whyNoOtherNetwork() const;
  void fillStatus(Diagnostics::Status& status) const;

  Settings settings_;
  drivers::LidarDriver driver_;
  ClockWatch clock_;
  MotionInput motion_;
  std::optional<std::uint8_t> truck_state_;
  std::string problem_ = "no scan yet";  // empty while proposals are valid
  double confidence_ = 0.0;              // of the last proposal
  ros::Publisher publisher_;
  ros::Subscriber scan_subscriber_, odometry_subscriber_, joint_subscriber_, status_subscriber_;
  ros::ServiceServer load_service_;
  Diagnostics diagnostics_;
};

}  // namespace tunnel_pilot::shell
