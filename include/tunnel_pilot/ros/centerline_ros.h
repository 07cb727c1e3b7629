#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <tunnel_pilot/Walls.h>

#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/diagnostics.h"

namespace tunnel_pilot::shell {

/// Shell of perception::CenterlineEstimator. Subscribes `walls` and `odom`; publishes `centerline`
/// (nav_msgs/Path in base_link, empty while there is none) and `tunnel_state`
/// (tunnel_pilot/TunnelState), in this order, for every walls message and with its stamp. Works without
/// odometry, for a shorter reach. Parameters: config/centerline.yaml. Throws config::ConfigError.
class CenterlineRos {
 public:
  CenterlineRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void onWalls(const Walls& message);
  void onOdometry(const nav_msgs::Odometry& message);
  void checkClock();
  void fillStatus(Diagnostics::Status& status) const;

  perception::CenterlineEstimator estimator_;
  drivers::MotionHistory odometry_;
  ClockWatch clock_;
  perception::TunnelState last_;
  unsigned long valid_ = 0;
  unsigned long invalid_ = 0;
  ros::Publisher path_publisher_;
  ros::Publisher state_publisher_;
  ros::Subscriber odometry_subscriber_;
  ros::Subscriber walls_subscriber_;
  Diagnostics diagnostics_;
};

}  // namespace tunnel_pilot::shell
