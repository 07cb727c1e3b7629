#include "tunnel_pilot/ros/stage.h"
#include "tunnel_pilot/ros/wall_segmentation_ros.h"

namespace tunnel_pilot::shell::node {

int wall_segmentation(int argc, char** argv) {
  return runStage<WallSegmentationRos>(argc, argv, "wall_segmentation");
}

}  // namespace tunnel_pilot::shell::node
