#include "tunnel_pilot/ros/lidar_driver_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int lidar_driver(int argc, char** argv) { return runStage<LidarDriverRos>(argc, argv, "lidar_driver"); }

}  // namespace tunnel_pilot::shell::node
