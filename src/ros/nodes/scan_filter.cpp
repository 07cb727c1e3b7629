#include "tunnel_pilot/ros/scan_filter_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int scan_filter(int argc, char** argv) { return runStage<ScanFilterRos>(argc, argv, "scan_filter"); }

}  // namespace tunnel_pilot::shell::node
