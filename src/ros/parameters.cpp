#include "tunnel_pilot/ros/parameters.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace tunnel_pilot::shell {
namespace {

// Keeps a double a double: "3.0", not "3", which would pass for a whole number.
std::string doubleText(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0.0 ? ".inf" : "-.inf";
  char text[32];
  // As few digits as tell the number, so that people can read it.
  for (int digits = 15; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  const std::string number = text;
  return number.find_first_of(".e") == std::string::npos ? number + ".0" : number;
}

YAML::Node mapToYaml(const XmlRpc::XmlRpcValue& value, const std::string& source) {
  YAML::Node map(YAML::NodeType::Map);
  for (const auto& entry : value) map[entry.first] = toYaml(entry.second, source);
  return map;
}

YAML::Node listToYaml(const XmlRpc::XmlRpcValue& value, const std::string& source) {
  YAML::Node list(YAML::NodeType::Sequence);
  for (int i = 0; i < value.size(); ++i) list.push_back(toYaml(value[i], source));
  return list;
}

YAML::Node textToYaml(const std::string& text) {
  YAML::Node node(text);
  node.SetTag("!");
  return node;
}

}  // namespace

YAML::Node toYaml(const XmlRpc::XmlRpcValue& value, const std::string& source) {
  XmlRpc::XmlRpcValue copy(value);  // the conversion operators are not const
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return YAML::Node(static_cast<bool>(copy) ? "true" : "false");
    case XmlRpc::XmlRpcValue::TypeInt:
      return YAML::Node(std::to_string(static_cast<int>(copy)));
    case XmlRpc::XmlRpcValue::TypeDouble:
      return YAML::Node(doubleText(static_cast<double>(copy)));
    case XmlRpc::XmlRpcValue::TypeString:
      return textToYaml(static_cast<std::string>(copy));
    case XmlRpc::XmlRpcValue::TypeArray:
      return listToYaml(value, source);
    case XmlRpc::XmlRpcValue::TypeStruct:
      return mapToYaml(value, source);
    default:
      throw config::ConfigError(source + ": a parameter is of a type that is not supported");
  }
}

Parameters::Parameters(const ros::NodeHandle& private_nh)
    : source_("parameters of " + private_nh.getNamespace()), yaml_(YAML::NodeType::Map) {
  XmlRpc::XmlRpcValue tree;
  if (!private_nh.getParam(private_nh.getNamespace(), tree)) return;
  yaml_ = toYaml(tree, source_);
  if (!yaml_.IsMap()) throw config::ConfigError(source_ + ": must be a map of keys");
}

config::Node Parameters::take(const std::set<std::string>& keys) {
  YAML::Node taken(YAML::NodeType::Map);
  for (const std::string& key : keys) {
    const YAML::Node& all = yaml_;
    if (!all[key].IsDefined()) continue;
    taken[key] = all[key];
    yaml_.remove(key);
  }
  return config::Node(taken, source_);
}

config::Node Parameters::rest() const { return config::Node(yaml_, source_); }

std::optional<std::string> takeOptional(Parameters& parameters, const std::string& key) {
  config::Node node = parameters.take({key});
  if (!node.has(key)) return std::nullopt;
  const std::string text = node.text(key);
  if (text.empty()) node.refuse(key, "is empty: leave it out instead");
  return text;
}

std::string takePublisher(Parameters& parameters, const ros::NodeHandle& nh) {
  const std::optional<std::string> name = takeOptional(parameters, "publisher");
  return name ? nh.resolveName(*name) : "";
}

vehicle::TruckParameters takeTruck(Parameters& parameters) {
  config::Node node = parameters.take({"truck_file"});
  return vehicle::loadTruck(node.text("truck_file"));
}

}  // namespace tunnel_pilot::shell
