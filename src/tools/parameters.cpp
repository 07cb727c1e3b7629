// Prints every parameter of the shipped configuration as one JSON list: file, key, value, unit, range,
// and how it may be tuned under way, if at all. The loaders themselves tell unit and range;
// scripts/generate_parameter_docs makes the tables from it.

#include <exception>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/drivers/step_driver.h"
#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"
#include "tunnel_pilot/simulation/simulator.h"
#include "tunnel_pilot/simulation/truck_controller.h"
#include "tunnel_pilot/supervision/arbiter_tuning.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace {

using namespace tunnel_pilot;  // NOLINT: a program, not a header

const std::vector<std::pair<std::string, std::function<void(const config::Node&)>>> kLoaders = {
    {"truck", [](const config::Node& node) { vehicle::loadTruck(node); }},
    {"scan_filter", [](const config::Node& node) { perception::loadScanFilter(node); }},
    {"wall_segmentation", [](const config::Node& node) { perception::loadWallSegmentation(node); }},
    {"centerline", [](const config::Node& node) { perception::loadCenterline(node); }},
    {"lidar_driver", [](const config::Node& node) { drivers::loadLidarDriver(node, ""); }},
    {"preview_driver", [](const config::Node& node) { drivers::loadPreviewDriver(node, ""); }},
    {"step_driver", [](const config::Node& node) { drivers::loadStepDriver(node); }},
    {"arbiter", [](const config::Node& node) { supervision::loadArbiter(node); }},
    {"can_bridge", [](const config::Node& node) { bridge::loadBridge(node); }},
    {"simulator", [](const config::Node& node) { simulation::loadSimulator(node); }},
    {"truck_controller", [](const config::Node& node) { simulation::loadTruckController(node); }},
};

// "lower" or "higher": where a change leads while the truck is under way. Empty: read once at the start.
std::string tuned(const std::string& file, const std::string& key) {
  if (file != "arbiter") return "";
  for (const supervision::ArbiterTunable& tunable : supervision::arbiterTunables()) {
    if (tunable.number.name == key) return tunable.number.higher_loosens ? "lower" : "higher";
  }
  return "";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string usage =
      "parameters CONFIG_FOLDER: prints every parameter as a JSON list of file, key, value, unit, "
      "range and tuning.\n";
  const std::string argument = argc == 2 ? argv[1] : "";
  if (argument == "--help" || argument == "-h") {
    std::cout << usage;
    return 0;
  }
  if (argument.empty() || argument[0] == '-') {
    std::cerr << usage;
    return 2;
  }
  try {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const auto& [name, load] : kLoaders) {
      const config::Node node = config::loadFile(argument + "/" + name + ".yaml");
      load(node);
      for (const config::ParameterRecord& r : node.records()) {
        list.push_back({{"file", name},
                        {"key", r.key},
                        {"value", r.value},
                        {"unit", r.unit},
                        {"range", r.range},
                        {"tuning", tuned(name, r.key)}});
      }
    }
    std::cout << list.dump(1) << "\n";
  } catch (const std::exception& e) {
    std::cerr << e.what() << "\n";
    return 1;
  }
  return 0;
}
