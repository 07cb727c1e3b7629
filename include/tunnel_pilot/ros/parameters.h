#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpcValue.h>
#include <yaml-cpp/yaml.h>

#include <optional>
#include <set>
#include <string>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

// This room's namespace is `shell`: tunnel_pilot::ros would hide roscpp's ::ros.
namespace tunnel_pilot::shell {

/// A parameter tree as YAML: ints, doubles and booleans become plain scalars, text is tagged "!" (as
/// yaml-cpp tags quoted scalars, so that "3" is no number). Throws config::ConfigError naming `source`
/// for values that YAML does not know (dates, binary).
YAML::Node toYaml(const XmlRpc::XmlRpcValue& value, const std::string& source);

/// The private parameters of a stage, read once. They are the stage's YAML file, read by the loader of
/// the core, plus a few keys that only the shell knows (names of files, of the bus): take() splits those
/// off, and rest() is what the core's loader gets, so that a key that nobody knows is refused by it.
class Parameters {
 public:
  /// Throws config::ConfigError when the namespace holds something that is no map of keys.
  explicit Parameters(const ros::NodeHandle& private_nh);

  /// The named keys that are present, as a map of their own.
  config::Node take(const std::set<std::string>& keys);

  /// All keys that were not taken.
  config::Node rest() const;

 private:
  std::string source_;
  YAML::Node yaml_;
};

/// The text parameter `key`, which may be absent.
std::optional<std::string> takeOptional(Parameters& parameters, const std::string& key);

/// The resolved name that the optional parameter `publisher` gives; empty without it.
std::string takePublisher(Parameters& parameters, const ros::NodeHandle& nh);

/// The truck whose YAML file the text parameter `truck_file` names. Throws config::ConfigError.
vehicle::TruckParameters takeTruck(Parameters& parameters);

}  // namespace tunnel_pilot::shell
