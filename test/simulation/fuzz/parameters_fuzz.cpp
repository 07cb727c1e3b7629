// Fuzz target of all files that a user writes (libFuzzer); scripts/fuzz builds and runs it. Every input
// is read as each kind of file; the parts of a file (a limiter, a lidar, a profile) are read with their
// wholes. Nothing but ConfigError may come out, and what was read must do to make a stage of.
#include <algorithm>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "../../fuzz.h"
#include "../../neural/small_network.h"
#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/drivers/step_driver.h"
#include "tunnel_pilot/perception/centerline.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/perception/wall_segmentation.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/simulation/simulator.h"
#include "tunnel_pilot/simulation/truck_controller.h"
#include "tunnel_pilot/supervision/arbiter.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"
#include "tunnel_pilot/world/world.h"

namespace {

using namespace tunnel_pilot;

/// Folders as the package has them, so that files beside the input are found.
class Place {
 public:
  Place() {
    namespace fs = std::filesystem;
    fs::create_directory(folder_.file("inputs"));
    for (const char* name : {"config", "scenarios", "worlds", "networks"}) {
      fs::create_directory_symlink(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/" + name,
                                   folder_.file(name));
    }
  }
  std::string folder() const { return folder_.file("inputs"); }
  std::string file() const { return folder_.file("inputs/fuzz.yaml"); }  // its stem is a scenario's name

 private:
  neural::Folder folder_;
};

template <class Load>
void refusedOrRead(const Load& load) {
  try {
    load();
  } catch (const config::ConfigError& e) {
    require(e.what()[0] != '\0', "a refusal says why");
  }
}

void readAll(const config::Node& node, const Place& place) {
  refusedOrRead([&] { perception::ScanFilter(perception::loadScanFilter(node)); });
  refusedOrRead([&] { perception::WallSegmentation(perception::loadWallSegmentation(node)); });
  refusedOrRead([&] { perception::CenterlineEstimator(perception::loadCenterline(node)); });
  refusedOrRead([&] { supervision::loadArbiter(node); });
  refusedOrRead([&] { bridge::loadBridge(node); });
  refusedOrRead([&] { vehicle::loadTruck(node); });
  refusedOrRead([&] { drivers::loadStepDriver(node); });
  refusedOrRead([&] { drivers::loadLidarDriver(node, place.folder()); });
  refusedOrRead([&] { drivers::loadPreviewDriver(node, place.folder()); });
  refusedOrRead([&] { simulation::loadSimulator(node); });
  refusedOrRead([&] { simulation::loadTruckController(node); });
  // These read the file anew, which takes longer than all the others together.
  if (node.has("start_at") || node.has("start")) refusedOrRead([&] { world::loadWorld(place.file()); });
  if (node.has("experiment")) refusedOrRead([&] { simulation::loadScenario(place.file()); });
}

using Lines = std::vector<std::string>;

Lines linesOf(const std::string& text) {
  Lines lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// The line behind what belongs to a key: lines that are further in, or a list's rows.
Lines::iterator endOfBlock(Lines& lines, Lines::iterator key) {
  const std::size_t indent = key->find_first_not_of(' ');
  return std::find_if(key + 1, lines.end(), [indent](const std::string& line) {
    const std::size_t in = line.find_first_not_of(' ');
    return in != std::string::npos && in <= indent && line[in] != '-';
  });
}

// Bytes changed at random make few files that are YAML still: here a key loses what belongs to it,
// stands twice, or gets another value.
std::string otherKey(const std::string& text, unsigned seed) {
  static const char* const kValues[] = {
      "[]",  "{}",      "~",    ".nan",  "-.inf", "0",     "-1",     "1",      "1e-320",   "1e308",
      "0.5", "1000000", "true", "\"1\"", "plain", "j1939", "[1, 2]", "{a: 1}", "../config"};
  std::minstd_rand random(seed);
  Lines lines = linesOf(text);
  if (lines.empty()) return text;
  const auto key = lines.begin() + static_cast<std::ptrdiff_t>(random() % lines.size());
  const auto end = endOfBlock(lines, key);
  const std::string value = kValues[random() % (sizeof kValues / sizeof *kValues)];
  const std::string renewed = key->substr(0, key->find(':')) + ": " + value;
  const Lines block(key, end);
  switch (random() % 4) {
    case 0:
      lines.insert(end, block.begin(), block.end());
      break;
    case 1:
      lines.erase(key, end);
      break;
    default:
      *key = renewed;
      lines.erase(key + 1, end);
  }
  std::string changed;
  for (const std::string& line : lines) changed += line + "\n";
  return changed;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  if (seed % 2 == 0) return LLVMFuzzerMutate(data, size, max_size);
  const std::string text = otherKey(std::string(reinterpret_cast<const char*>(data), size), seed);
  const std::size_t length = std::min(text.size(), max_size);
  std::copy_n(text.begin(), length, data);
  return length;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Place place;
  {
    std::ofstream out(place.file(), std::ios::binary | std::ios::trunc);
    out.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  }
  refusedOrRead([&] { readAll(config::loadFile(place.file()), place); });
  return 0;
}
