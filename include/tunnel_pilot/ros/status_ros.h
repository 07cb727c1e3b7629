#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/ros/latest.h"
#include "tunnel_pilot/ros/status_line.h"

namespace tunnel_pilot::shell {

/// Shell of statusLine(): gives `tell` a line a second, and one at once when state, reason or driver
/// change. Subscribes `truck_status`, `arbiter_state`, `command`, `tunnel_state`, `odom`, `scan`,
/// `joint_states`, `lidar_driver/proposal`; what is silent for 1 s is not told any more. No
/// parameters. May run before there is a pilot: follows /use_sim_time whenever it is set. Throws
/// config::ConfigError for any parameter that is given.
class StatusRos {
 public:
  using Tell = std::function<void(const std::string& line, Gravity gravity)>;
  StatusRos(ros::NodeHandle nh, ros::NodeHandle private_nh, Tell tell);

 private:
  template <class Message>
  void listen(ros::NodeHandle& nh, const std::string& topic, Latest<Message>& latest);
  StatusInput input() const;
  void followClock();
  void update();

  ros::NodeHandle nh_;
  Tell tell_;
  Latest<TruckStatus> truck_status_;
  Latest<ArbiterState> arbiter_state_;
  Latest<TruckCommand> command_;
  Latest<TunnelState> tunnel_state_;
  Latest<nav_msgs::Odometry> odometry_;
  Latest<Proposal> network_;
  std::optional<ros::Time> scan_, feedback_;  // stamps of the last
  StatusPace pace_;
  std::vector<ros::Subscriber> subscribers_;
  ros::Subscriber clock_subscriber_;
  ros::WallTimer timer_;
};

}  // namespace tunnel_pilot::shell
