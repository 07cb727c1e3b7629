#include "tunnel_pilot/ros/stage.h"
#include "tunnel_pilot/ros/step_driver_ros.h"

namespace tunnel_pilot::shell::node {

int step_driver(int argc, char** argv) { return runStage<StepDriverRos>(argc, argv, "step_driver"); }

}  // namespace tunnel_pilot::shell::node
