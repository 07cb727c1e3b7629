#include "tunnel_pilot/ros/can_bridge_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::CanBridgeRos>(argc, argv, "can_bridge");
}
