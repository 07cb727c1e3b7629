#include "tunnel_pilot/ros/preview_driver_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::PreviewDriverRos>(argc, argv,
                                                                              "preview_driver");
}
