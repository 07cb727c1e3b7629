#include "tunnel_pilot/ros/live_tuning.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/console.h>

#include <utility>

namespace tunnel_pilot::shell {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigDescription;

constexpr const char* kGroup = "Default";  // the protocol's clients want one

Config configOf(const std::vector<config::TunableNumber>& numbers, const std::vector<double>& values) {
  Config config;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    dynamic_reconfigure::DoubleParameter parameter;
    parameter.name = numbers[i].name;
    parameter.value = values[i];
    config.doubles.push_back(parameter);
  }
  dynamic_reconfigure::GroupState group;
  group.name = kGroup;
  group.state = 1;
  config.groups.push_back(group);
  return config;
}

ConfigDescription describe(const config::Tuning& tuning) {
  dynamic_reconfigure::Group group;
  group.name = kGroup;
  std::vector<double> lowest, highest;
  for (const config::TunableNumber& number : tuning.numbers()) {
    dynamic_reconfigure::ParamDescription parameter;
    parameter.name = number.name;
    parameter.type = "double";
    parameter.description = "[" + number.unit + "] under way it may only be " +
                            (number.higher_loosens ? "lowered" : "raised");
    group.parameters.push_back(parameter);
    lowest.push_back(number.min);
    highest.push_back(number.max);
  }
  ConfigDescription description;
  description.groups.push_back(group);
  description.min = configOf(tuning.numbers(), lowest);
  description.max = configOf(tuning.numbers(), highest);
  description.dflt = configOf(tuning.numbers(), tuning.values());
  return description;
}

// The first of another type, if any: all our numbers are doubles.
std::string mistyped(const Config& config) {
  if (!config.bools.empty()) return config.bools.front().name;
  if (!config.ints.empty()) return config.ints.front().name;
  return config.strs.empty() ? "" : config.strs.front().name;
}

}  // namespace

LiveTuning::LiveTuning(ros::NodeHandle private_nh, config::Tuning tuning,
                       std::function<bool()> may_loosen, std::function<void(const Values&)> apply)
    : name_(private_nh.getNamespace()),
      tuning_(std::move(tuning)),
      may_loosen_(std::move(may_loosen)),
      apply_(std::move(apply)),
      descriptions_publisher_(
          private_nh.advertise<ConfigDescription>("parameter_descriptions", 1, true)),
      updates_publisher_(private_nh.advertise<Config>("parameter_updates", 1, true)) {
  descriptions_publisher_.publish(describe(tuning_));
  updates_publisher_.publish(configOf(tuning_.numbers(), tuning_.values()));
  service_ = private_nh.advertiseService("set_parameters", &LiveTuning::onRequest, this);
}

bool LiveTuning::onRequest(Reconfigure::Request& request, Reconfigure::Response& response) {
  const std::string other_type = mistyped(request.config);
  config::Tuning::Request wanted;
  for (const auto& parameter : request.config.doubles) {
    wanted.emplace_back(parameter.name, parameter.value);
  }
  refusal_ = other_type.empty() ? tuning_.change(wanted, !may_loosen_()).value_or("")
                                : other_type + " is not given as a number with a fraction (double)";
  if (refusal_.empty()) {
    apply_(tuning_.values());
    for (const auto& [key, value] : wanted) {
      ROS_INFO("%s: %s is %g now", name_.c_str(), key.c_str(), value);
    }
  } else {
    ROS_ERROR("%s: nothing was changed: %s", name_.c_str(), refusal_.c_str());
  }
  response.config = configOf(tuning_.numbers(), tuning_.values());
  updates_publisher_.publish(response.config);
  return true;
}

}  // namespace tunnel_pilot::shell
