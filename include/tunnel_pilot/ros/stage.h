#pragma once

#include <nodelet/nodelet.h>
#include <ros/ros.h>

#include <exception>
#include <memory>
#include <string>

#include "tunnel_pilot/ros/executor.h"
#include "tunnel_pilot/ros/heartbeat.h"

namespace tunnel_pilot::shell {

/// A stage as nodelet: its callbacks run one at a time, its heartbeat among them, in one thread with
/// those of the other stages that name the same `executor` in this namespace and manager; of lower
/// `rank` first (Executor). A stage that refuses its parameters is not loaded; the log says why.
template <class Stage, const char* executor, int rank>
class StageNodelet : public nodelet::Nodelet {
 public:
  ~StageNodelet() override {
    if (queue_) queue_->stop();  // before the stage ends, member by member
  }

 private:
  void onInit() override {
    ros::NodeHandle nh = getNodeHandle();
    ros::NodeHandle private_nh = getPrivateNodeHandle();
    executor_ = Executor::named(executor + (" of " + nh.getNamespace()));
    queue_ = std::make_unique<Executor::Queue>(*executor_, rank);
    nh.setCallbackQueue(queue_.get());
    private_nh.setCallbackQueue(queue_.get());
    try {
      stage_ = std::make_unique<Stage>(nh, private_nh);
      heartbeat_ = std::make_unique<Heartbeat>(nh, getName());
    } catch (const std::exception& e) {
      NODELET_FATAL("%s", e.what());
      throw;
    }
    queue_->start();
  }

  std::shared_ptr<Executor> executor_;
  std::unique_ptr<Executor::Queue> queue_;
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
