#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_srvs/Trigger.h>

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/diagnostics.h"
#include "tunnel_pilot/ros/live_tuning.h"
#include "tunnel_pilot/ros/motion_input.h"
#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::shell {

/// Shell of supervision::Arbiter. Subscribes `lidar_driver/proposal`, `preview_driver/proposal`,
/// `teleoperation/proposal`, `walls`, `points`, `scan_rejected`, `tunnel_state` with `centerline`,
/// `odom`, `joint_states`, `truck_status`; publishes `command` and `arbiter_state`. Decides on every
/// proposal and on a timer of 50 Hz (steady time, or simulated time with use_sim_time), so that silent
/// inputs end in a stop, not in silence. Services ~stop and ~reset (std_srvs/Trigger) latch a stop and
/// end it, for a truck without can_bridge; with it, use the bridge's. Services ~use/lidar_driver and
/// ~use/preview_driver (std_srvs/Trigger) select the driver, driving or not; the first is selected at
/// the start. Numbers of supervision::arbiterTunables() are changed while it runs by LiveTuning.
/// Parameters: config/arbiter.yaml and `truck_file`. Throws config::ConfigError.
class ArbiterRos {
 public:
  ArbiterRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  template <class Message, class Callback>
  void listen(ros::NodeHandle& nh, const std::string& topic, Callback callback);
  void subscribe(ros::NodeHandle& nh);
  void offerDriver(ros::NodeHandle& private_nh, supervision::Source driver);
  void onProposal(supervision::Source source, const Proposal& message);
  bool onStop(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void onPoints(const sensor_msgs::PointCloud2& message);
  void updateMotion();
  void updateTunnel();
  void checkClock();
  void decide();
  std::string unheardTopics() const;
  void fillStatus(Diagnostics::Status& status) const;

  supervision::Arbiter arbiter_;
  supervision::Decision last_;
  std::optional<supervision::Reason> told_;  // in the log; none before the first decision
  ClockWatch clock_;
  MotionInput motion_;
  TunnelInput tunnel_;
  std::set<std::string> unheard_;  // topics that must speak before the first drive
  unsigned long motion_refused_ = 0;
  ros::Publisher command_publisher_, state_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  ros::ServiceServer stop_service_, reset_service_;
  std::vector<ros::ServiceServer> driver_services_;
  ros::WallTimer wall_timer_;
  ros::Timer timer_;
  LiveTuning tuning_;
  Diagnostics diagnostics_;
};

}  // namespace tunnel_pilot::shell
