#include "tunnel_pilot/ros/arbiter_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::ArbiterRos>(argc, argv, "arbiter");
}
