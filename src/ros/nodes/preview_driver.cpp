#include "tunnel_pilot/ros/preview_driver_ros.h"
#include "tunnel_pilot/ros/stage.h"

namespace tunnel_pilot::shell::node {

int preview_driver(int argc, char** argv) {
  return runStage<PreviewDriverRos>(argc, argv, "preview_driver");
}

}  // namespace tunnel_pilot::shell::node
