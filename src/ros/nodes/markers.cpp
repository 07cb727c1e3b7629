#include "tunnel_pilot/ros/markers_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int markers(int argc, char** argv) { return runStage<MarkersRos>(argc, argv, "markers"); }

}  // namespace tunnel_pilot::shell::node
