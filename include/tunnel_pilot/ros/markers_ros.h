#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/Walls.h>
#include <visualization_msgs/MarkerArray.h>

#include <optional>

namespace tunnel_pilot::shell {

/// Pictures for rviz' stock displays of what the pilot measures and intends. Subscribes `walls`,
/// `arbiter_state`, `preview_driver/proposal`, `truck_status`, `odom`; publishes `markers`
/// (visualization_msgs/MarkerArray) with namespaces wall_left, wall_right (returns and curves),
/// preview_point, corridor (swept by both bodies, green where far from the walls, red where near),
/// driven_path (in odom) and state (the safety state and its reason in words). Costs nothing while
/// nobody looks. No parameters. Throws config::ConfigError for any that is given.
class MarkersRos {
 public:
  MarkersRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void onWalls(const Walls& message);
  void onArbiterState(const ArbiterState& message);
  void onProposal(const Proposal& message);
  void onTruckStatus(const TruckStatus& message);
  void onOdometry(const nav_msgs::Odometry& message);
  void publish(const visualization_msgs::MarkerArray& markers) const;

  Walls walls_;
  TruckStatus truck_status_;
  visualization_msgs::Marker driven_path_;
  ros::Publisher publisher_;
  ros::Subscriber walls_subscriber_, arbiter_subscriber_, proposal_subscriber_, status_subscriber_,
      odometry_subscriber_;
};

}  // namespace tunnel_pilot::shell
