#include "tunnel_pilot/ros/stage.h"
#include "tunnel_pilot/ros/step_driver_ros.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::StepDriverRos>(argc, argv, "step_driver");
}
