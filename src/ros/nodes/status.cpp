// One line a second, and at every change, of what the pilot does and why; coloured on a terminal.
#include <ros/ros.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <string>

#include "tunnel_pilot/ros/status_ros.h"

namespace tunnel_pilot::shell::node {

int status(int argc, char** argv) {
  ros::init(argc, argv, "status", ros::init_options::AnonymousName);
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  const bool terminal = isatty(STDOUT_FILENO) != 0;
  const auto tell = [terminal](const std::string& line, Gravity gravity) {
    std::printf("%s\n", (terminal ? coloured(line, gravity) : line).c_str());
    std::fflush(stdout);
  };
  try {
    const StatusRos status{ros::NodeHandle(), ros::NodeHandle("~"), tell};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}

}  // namespace tunnel_pilot::shell::node
