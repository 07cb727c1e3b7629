#include "tunnel_pilot/ros/can_bridge_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int can_bridge(int argc, char** argv) { return runStage<CanBridgeRos>(argc, argv, "can_bridge"); }

}  // namespace tunnel_pilot::shell::node
