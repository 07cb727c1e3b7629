#include "tunnel_pilot/ros/lap_monitor.h"

#include <ros/ros.h>

#include <cstdio>
#include <exception>

// Exit status 0: the lap passed. 1: it failed, or the parameters were refused.
int main(int argc, char** argv) {
  ros::init(argc, argv, "lap_monitor");
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  try {
    tunnel_pilot::shell::LapMonitor monitor{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
    return monitor.passed().value_or(false) ? 0 : 1;
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
}
