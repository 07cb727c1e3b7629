#pragma once

#include <string>
#include <vector>

namespace tunnel_pilot::simulation {

/// SHA-256 over the contents of these files, one after the other (what `cat files | sha256sum` tells).
/// Throws config::ConfigError when one cannot be read.
std::string sha256OfFiles(const std::vector<std::string>& files);

/// What a report was made from.
struct Fingerprints {
  std::string scenario;
  std::string controller;                ///< the parameter files of the pilot
  std::string plant;                     ///< those of truck and simulator
  std::string world;                     ///< empty without a world
  std::string driver{"preview_driver"};  ///< who proposed: the name of a DriverChoice
  std::string network{};                 ///< the lidar driver's; empty without
  std::string command{};                 ///< that gives the same results; empty where there is none
};

}  // namespace tunnel_pilot::simulation
