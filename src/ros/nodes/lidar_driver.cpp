#include "tunnel_pilot/ros/lidar_driver_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::LidarDriverRos>(argc, argv, "lidar_driver");
}
