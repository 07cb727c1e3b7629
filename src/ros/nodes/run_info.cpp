#include "tunnel_pilot/ros/run_info.h"

#include <ros/ros.h>

#include <exception>

namespace tunnel_pilot::shell::node {

int run_info(int argc, char** argv) {
  ros::init(argc, argv, "run_info");
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  try {
    const RunInfo info{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}

}  // namespace tunnel_pilot::shell::node
