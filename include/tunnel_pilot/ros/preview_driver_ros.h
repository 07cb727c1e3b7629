#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/diagnostics.h"
#include "tunnel_pilot/ros/motion_input.h"

namespace tunnel_pilot::shell {

/// Shell of drivers::PreviewDriver or NeuralPreviewDriver, as the parameter `law` says. Subscribes
/// `tunnel_state` and `centerline` (paired by stamp), `odom`, `joint_states`; publishes
/// `preview_driver/proposal` (tunnel_pilot/Proposal) for every tunnel once the truck's motion is known.
/// Parameters: config/preview_driver.yaml and `truck_file` (path of the truck's YAML; a relative name of
/// the network's file is looked for from its folder). Throws config::ConfigError.
class PreviewDriverRos {
 public:
  PreviewDriverRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void onState(const TunnelState& message);
  void onCenterline(const nav_msgs::Path& message);
  void onOdometry(const nav_msgs::Odometry& message);
  void onJointState(const sensor_msgs::JointState& message);
  void propose();
  void fillStatus(Diagnostics::Status& status) const;

  std::unique_ptr<drivers::PathDriver> driver_;
  ClockWatch clock_;
  TunnelInput tunnel_;
  MotionInput motion_;
  std::string problem_ = "no tunnel yet";  // empty while proposals are valid
  ros::Publisher publisher_;
  ros::Subscriber state_subscriber_, centerline_subscriber_, odometry_subscriber_, joint_subscriber_;
  Diagnostics diagnostics_;
};

}  // namespace tunnel_pilot::shell
