#include "tunnel_pilot/ros/scan_filter_ros.h"
#include "tunnel_pilot/ros/stage.h"

int main(int argc, char** argv) {
  return tunnel_pilot::shell::runStage<tunnel_pilot::shell::ScanFilterRos>(argc, argv, "scan_filter");
}
