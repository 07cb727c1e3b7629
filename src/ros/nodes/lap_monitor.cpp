#include "tunnel_pilot/ros/lap_monitor.h"

#include <ros/ros.h>

#include <cstdio>
#include <exception>

namespace tunnel_pilot::shell::node {

// Exit status 0: the lap passed. 1: it failed, or the parameters were refused.
int lap_monitor(int argc, char** argv) {
  ros::init(argc, argv, "lap_monitor");
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  try {
    LapMonitor monitor{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
    return monitor.passed().value_or(false) ? 0 : 1;
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
}

}  // namespace tunnel_pilot::shell::node
