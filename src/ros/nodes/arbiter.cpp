#include "tunnel_pilot/ros/arbiter_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int arbiter(int argc, char** argv) { return runStage<ArbiterRos>(argc, argv, "arbiter"); }

}  // namespace tunnel_pilot::shell::node
