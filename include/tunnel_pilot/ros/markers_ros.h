#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/TunnelState.h>
#include <tunnel_pilot/Walls.h>
#include <visualization_msgs/MarkerArray.h>

#include "tunnel_pilot/ros/latest.h"
#include "tunnel_pilot/ros/status_text.h"

namespace tunnel_pilot::shell {

/// Pictures for rviz' stock displays of what the pilot measures and intends. Subscribes `walls`,
/// `tunnel_state`, `arbiter_state`, `command`, `preview_driver/proposal`, `lidar_driver/proposal`,
/// `truck_status`, `odom`; publishes `markers` (visualization_msgs/MarkerArray) with namespaces
/// wall_left, wall_right (returns, curves and the faces that stand on them), preview_point, corridor
/// (swept by both bodies, green where far from the walls, red where near), free_distance and
/// stopping_distance (stopping_markers.h), network (each output a bar
/// before the truck, in the direction of its articulation and as long as it is probable, and the decoded
/// one as an arrow), driven_path (in odom, since the pilot was last engaged, the odometry jumped or the
/// clock went back) and status (in words: status_text.h). Sizes follow the tunnel's width, so that a
/// robot's corridor looks like a truck's drift. Costs little while nobody looks. Parameter: `truck_file`
/// (path of the truck's YAML). Throws config::ConfigError.
class MarkersRos {
 public:
  MarkersRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void onWalls(const Walls& message);
  void onTunnelState(const TunnelState& message);
  void onArbiterState(const ArbiterState& message);
  void onProposal(const Proposal& message);
  void onNetwork(const Proposal& message);
  void onTruckStatus(const TruckStatus& message);
  void onOdometry(const nav_msgs::Odometry& message);
  void publishStatus();
  void publishDrivenPath();
  bool isSeen() const { return publisher_.getNumSubscribers() > 0; }

  Walls walls_;
  Latest<TruckStatus> truck_status_;
  Latest<ArbiterState> arbiter_state_;
  Latest<TruckCommand> command_;
  Latest<TunnelState> tunnel_state_;
  Latest<nav_msgs::Odometry> odometry_;
  Latest<Proposal> network_;
  double scale_ = 0.5;      // of what is drawn: the tunnel's width over a drift's, slowly followed
  double front_overhang_;   // of the truck's nose before its front axle [m]
  bool is_scaled_ = false;  // a width was seen
  ros::SteadyTime corridor_drawn_;
  visualization_msgs::Marker driven_path_;
  ros::Publisher publisher_;
  ros::Subscriber walls_subscriber_, tunnel_subscriber_, arbiter_subscriber_, command_subscriber_,
      proposal_subscriber_, network_subscriber_, status_subscriber_, odometry_subscriber_;
  ros::WallTimer timer_;
};

}  // namespace tunnel_pilot::shell
