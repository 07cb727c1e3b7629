#pragma once

#include <ros/node_handle.h>
#include <rosgraph_msgs/Clock.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tunnel_pilot/Heartbeat.h>
#include <tunnel_pilot/TruckCommand.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/bridge/heartbeat_watch.h"
#include "tunnel_pilot/bridge/operator_socket.h"
#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/diagnostics.h"
#include "tunnel_pilot/ros/publisher_watch.h"

namespace tunnel_pilot::shell {

/// Shell of bridge::CanBridge on an embedded bus or on SocketCAN. Subscribes `command`, and `heartbeat`
/// where `heartbeats` names nodes that must be heard; publishes `joint_states` (articulation_joint),
/// `odom`, TF odom -> base_link for every feedback of the truck, and `truck_status` with each of them
/// and at least ten times a second. Services engage, release, stop, reset (std_srvs/Trigger): the
/// message of a refusal says why.
///
/// Time: without use_sim_time a steady timer of 200 Hz ticks the bridge; with it, each message of /clock
/// does, so that a simulator in lockstep finds the bridge's frames at the same ticks in every run.
///
/// Parameters: config/can_bridge.yaml, `truck_file` (path of the truck's YAML) and either `bus` (name of
/// an embedded bus) or `interface` (of SocketCAN; never with use_sim_time). Without a meaning unless
/// they are there: `publisher` (the only node that may publish `command`) and `operator_socket` (path of
/// a bridge::OperatorSocket; then engage and reset are no services, only edges there). Throws
/// config::ConfigError, and std::exception when the bus cannot be joined.
class CanBridgeRos {
 public:
  CanBridgeRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  using Trigger = std_srvs::Trigger;
  using Edge = bridge::CanBridge::Answer (bridge::CanBridge::*)(Stamp);

  using CommandEvent = ros::MessageEvent<const TruckCommand>;
  void onCommand(const CommandEvent& event);
  void tick(Stamp now);
  Stamp current() const;
  bridge::CanBridge::Answer serveEdge(const std::string& name, Edge edge);
  void hearOperator();
  void watchNodes(ros::NodeHandle& nh, const bridge::BridgeParameters& parameters);
  void watchProcesses();
  void tellTrouble();
  void publishMotion();
  void publishStatus(Stamp now);
  void advertiseEdge(ros::NodeHandle& nh, const std::string& name, Edge edge);
  void fillStatus(Diagnostics::Status& status) const;

  std::unique_ptr<can::Bus> bus_;
  std::unique_ptr<bridge::CanBridge> bridge_;
  std::unique_ptr<bridge::HeartbeatWatch> heartbeats_;
  std::unique_ptr<bridge::OperatorSocket> operator_socket_;
  std::optional<std::string> silent_;
  ClockWatch clock_;
  Stamp last_tick_{};
  Stamp published_motion_{};
  Stamp published_status_{};
  std::optional<std::uint32_t> told_transitions_;  // none: not even the state at the start
  std::string told_trouble_;

  ros::Publisher joint_publisher_, odometry_publisher_, status_publisher_;
  tf2_ros::TransformBroadcaster transform_broadcaster_;
  std::vector<ros::ServiceServer> services_;
  PublisherWatch publishers_;  // of command
  ros::Subscriber command_subscriber_, heartbeat_subscriber_, clock_subscriber_;
  ros::WallTimer timer_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

}  // namespace tunnel_pilot::shell
