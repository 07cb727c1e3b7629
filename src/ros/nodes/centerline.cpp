#include "tunnel_pilot/ros/centerline_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int centerline(int argc, char** argv) { return runStage<CenterlineRos>(argc, argv, "centerline"); }

}  // namespace tunnel_pilot::shell::node
