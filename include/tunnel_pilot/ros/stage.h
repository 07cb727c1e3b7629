#pragma once

#include <nodelet/nodelet.h>
#include <ros/ros.h>

#include <exception>
#include <memory>
#include <string>

#include "tunnel_pilot/ros/heartbeat.h"
#include "tunnel_pilot/ros/lane.h"

namespace tunnel_pilot::shell {

/// Where a nodelet runs.
struct LaneRule {
  const char* name;
  double pace;  ///< [s] 0: woken by each message
};

/// A stage as nodelet: its callbacks run one at a time in the lane of that name, its heartbeat among
/// them; it is made and ended there, too, so that none of them meets half a stage. A stage that refuses
/// its parameters is not loaded; the log says why.
template <class Stage, const LaneRule& kLane>
class StageNodelet : public nodelet::Nodelet {
 public:
  ~StageNodelet() override {
    if (!lane_) return;
    lane_->run([this] {
      heartbeat_.reset();
      stage_.reset();
    });
  }

 private:
  void onInit() override {
    ros::NodeHandle nh = getNodeHandle();
    ros::NodeHandle private_nh = getPrivateNodeHandle();
    lane_ = Lane::named(kLane.name + (" of " + nh.getNamespace()),
                        ros::WallDuration(kLane.pace));  // several pilots may share a manager
    nh.setCallbackQueue(&lane_->queue());
    private_nh.setCallbackQueue(&lane_->queue());
    try {
      lane_->run([&] {
        stage_ = std::make_unique<Stage>(nh, private_nh);
        heartbeat_ = std::make_unique<Heartbeat>(nh, getName());
      });
    } catch (const std::exception& e) {
      NODELET_FATAL("%s", e.what());
      throw;
    }
  }

  std::shared_ptr<Lane> lane_;
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
