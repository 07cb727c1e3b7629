#include "tunnel_pilot/ros/run_info.h"

#include <ros/console.h>
#include <std_msgs/String.h>
#include <yaml-cpp/yaml.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "tunnel_pilot/config/sha256.h"
#include "tunnel_pilot/ros/parameters.h"
#include "tunnel_pilot/ros/pilot_nodes.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kLook = 0.2;      // [s] steady time
constexpr double kPatience = 5.0;  // for parameters and network [s] steady time
constexpr const char* kSimulator = "simulator";
constexpr const char* kTextTag = "!";  // of texts in what toYaml() gives

std::string seconds(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f", value);
  return text;
}

// Text in quotes, so that "3" stays no number; everything else plain.
void emit(const YAML::Node& node, YAML::Emitter& out) {
  if (node.IsMap()) {
    out << YAML::BeginMap;
    for (const auto& entry : node) {
      out << YAML::Key << entry.first.as<std::string>() << YAML::Value;
      emit(entry.second, out);
    }
    out << YAML::EndMap;
  } else if (node.IsSequence()) {
    out << YAML::BeginSeq;
    for (const auto& entry : node) emit(entry, out);
    out << YAML::EndSeq;
  } else {
    if (node.Tag() == kTextTag) out << YAML::DoubleQuoted;
    out << node.Scalar();
  }
}

// The files that a tree of parameters names by their absolute paths.
void collectFiles(const YAML::Node& node, std::set<std::string>& files) {
  if (node.IsScalar()) {
    std::error_code ignored;
    const std::filesystem::path path(node.Scalar());
    if (path.is_absolute() && std::filesystem::is_regular_file(path, ignored)) files.insert(path);
    return;
  }
  for (const auto& entry : node) collectFiles(node.IsMap() ? entry.second : entry, files);
}

void emitFiles(const std::set<std::string>& files, YAML::Emitter& out) {
  out << YAML::Key << "files" << YAML::Value << YAML::BeginMap;
  for (const std::string& file : files) {
    std::ostringstream content;
    std::ifstream in(file, std::ios::binary);
    if (!in || !(content << in.rdbuf())) continue;
    out << YAML::Key << file << YAML::Value << config::sha256(content.str());
  }
  out << YAML::EndMap;
}

}  // namespace

std::string runInfoText(const RunFacts& facts) {
  YAML::Emitter out;
  std::set<std::string> files;
  out << YAML::BeginMap;
  out << YAML::Key << "package" << YAML::Value << "tunnel_pilot";
  out << YAML::Key << "version" << YAML::Value << YAML::DoubleQuoted << TUNNEL_PILOT_VERSION;
  out << YAML::Key << "time" << YAML::Value << seconds(facts.time.toSec());
  out << YAML::Key << "system_time" << YAML::Value << seconds(facts.system_time);
  out << YAML::Key << "networks" << YAML::Value << YAML::BeginSeq;
  for (const std::string& model : facts.models) out << YAML::DoubleQuoted << model;
  out << YAML::EndSeq;
  out << YAML::Key << "parameters" << YAML::Value << YAML::BeginMap;
  for (const auto& [node, values] : facts.parameters) {
    const YAML::Node tree = toYaml(values, "parameters of " + node);
    out << YAML::Key << node << YAML::Value;
    emit(tree, out);
    collectFiles(tree, files);
  }
  out << YAML::EndMap;
  emitFiles(files, out);
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

RunInfo::RunInfo(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : nh_(nh), publisher_(nh.advertise<std_msgs::String>("run_info", 1, true)) {
  Parameters(private_nh).rest().finish();
  lidar_subscriber_ = nh.subscribe("lidar_driver/proposal", 5, &RunInfo::onProposal, this);
  preview_subscriber_ = nh.subscribe("preview_driver/proposal", 5, &RunInfo::onProposal, this);
  timer_ =
      nh.createWallTimer(ros::WallDuration(kLook), [this](const ros::WallTimerEvent&) { onTimer(); });
}

void RunInfo::onProposal(const Proposal& message) {
  if (message.model.empty() || !models_.insert(message.model).second) return;
  if (told_) tell();
}

void RunInfo::onTimer() {
  if (told_) return timer_.stop();
  const bool late = (ros::SteadyTime::now() - started_).toSec() > kPatience;
  if (isComplete() || late) tell();
}

bool RunInfo::isComplete() const {
  const bool time_runs = !ros::Time::now().isZero();
  return time_runs && nh_.hasParam("scan_filter") && (!models_.empty() || !nh_.hasParam("lidar_driver"));
}

void RunInfo::tell() {
  RunFacts facts;
  facts.time = ros::Time::now();
  facts.system_time = ros::WallTime::now().toSec();
  facts.models = models_;
  std::vector<std::string> nodes(kPilotNodes.begin(), kPilotNodes.end());
  nodes.emplace_back(kSimulator);
  for (const std::string& node : nodes) {
    XmlRpc::XmlRpcValue values;
    if (nh_.getParam(node, values)) facts.parameters[nh_.resolveName(node)] = values;
  }
  if (facts.parameters.empty()) ROS_WARN("run_info: no node of the pilot has parameters here");
  std_msgs::String message;
  message.data = runInfoText(facts);
  publisher_.publish(message);
  told_ = true;
}

}  // namespace tunnel_pilot::shell
