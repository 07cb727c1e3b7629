#include "tunnel_pilot/ros/markers_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::MarkersRos>(argc, argv, "markers");
}
