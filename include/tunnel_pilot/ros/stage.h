#pragma once

#include <nodelet/nodelet.h>
#include <ros/ros.h>

#include <exception>
#include <memory>
#include <string>

#include "tunnel_pilot/ros/heartbeat.h"

namespace tunnel_pilot::shell {

/// A stage as nodelet: its callbacks run one at a time (single-threaded queue of the manager), its
/// heartbeat among them. A stage
/// that refuses its parameters is not loaded; the log says why.
template <class Stage>
class StageNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      stage_ = std::make_unique<Stage>(getNodeHandle(), getPrivateNodeHandle());
      heartbeat_ = std::make_unique<Heartbeat>(getNodeHandle(), getName());
    } catch (const std::exception& e) {
      NODELET_FATAL("%s", e.what());
      throw;
    }
  }

  std::unique_ptr<Stage> stage_;
  std::unique_ptr<Heartbeat> heartbeat_;
};

/// A stage as a node of its own. Exit status 1 when it refuses its parameters; the log says why.
template <class Stage>
int runStage(int argc, char** argv, const std::string& name) {
  ros::init(argc, argv, name);
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  try {
    Stage stage{ros::NodeHandle(), ros::NodeHandle("~")};
    const Heartbeat heartbeat(ros::NodeHandle(), ros::this_node::getName());
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}

}  // namespace tunnel_pilot::shell
