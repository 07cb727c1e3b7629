#include "tunnel_pilot/ros/centerline_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::CenterlineRos>(argc, argv, "centerline");
}
