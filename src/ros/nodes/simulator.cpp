#include <ros/ros.h>

#include <exception>

#include "tunnel_pilot/ros/simulator_ros.h"

namespace tunnel_pilot::shell::node {

int simulator(int argc, char** argv) {
  ros::init(argc, argv, "simulator");
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  try {
    SimulatorRos simulator{ros::NodeHandle(), ros::NodeHandle("~")};
    while (ros::ok()) simulator.advance();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}

}  // namespace tunnel_pilot::shell::node
