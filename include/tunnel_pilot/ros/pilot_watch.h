#pragma once

#include <ros/node_handle.h>

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tunnel_pilot/ros/self_check.h"
#include "tunnel_pilot/ros/sensor_pose.h"

namespace tunnel_pilot::shell {

/// Watches a running pilot for the self-check: subscribes `heartbeat`, `scan`, `joint_states`, `odom`,
/// `command`, `lidar_driver/proposal`, `truck_status`, `arbiter_state`, and asks the master who
/// publishes.
class PilotWatch {
 public:
  explicit PilotWatch(ros::NodeHandle nh);

  /// Serves callbacks until enough was seen, 5 s of steady time at the most.
  void watch();

  /// What was seen.
  CheckFacts facts();

 private:
  struct Arrivals {
    std::optional<ros::Time> first, last;  // ROS time when messages came
    std::size_t count = 0;
    std::vector<double> ages;  // [s]
  };

  template <class Message>
  void count(const std::string& topic);
  std::map<std::string, std::vector<std::string>> publishers() const;
  TopicFacts topicFacts(const Arrivals& arrivals) const;

  ros::NodeHandle nh_;
  std::vector<ros::Subscriber> subscribers_;
  SensorPose sensor_pose_;
  CheckFacts facts_;
  std::map<std::string, Arrivals> arrivals_;
  std::set<std::string> alive_;  // resolved names of those whose heartbeat came
};

}  // namespace tunnel_pilot::shell
