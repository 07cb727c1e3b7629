#include "tunnel_pilot/ros/self_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/ros/pilot_nodes.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kLeastRate = 10.0;           // a gap of 0.1 s slows down or stops [1/s]
constexpr double kLeastPassed = 0.2;          // of ROS time: less is a clock that stands still [s]
constexpr double kFuture = 0.1, kPast = 0.5;  // of stamps [s]

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

Finding clockFinding(const CheckFacts& facts) {
  if (facts.clock_passed >= kLeastPassed) {
    return {true, facts.sim_time ? "clock: simulated time goes on" : "clock: system time", ""};
  }
  if (!facts.sim_time) return {false, "clock: the system's time stands still", "set the system's clock"};
  return {false, "clock: /use_sim_time is set, but simulated time stands still",
          "start or continue the simulator or the bag (--clock), or `rosparam set /use_sim_time false`"};
}

// A truck of one's own needs no bridge, and the network may be left out.
bool isOptional(const std::string& node) { return node == "lidar_driver" || node == "can_bridge"; }

std::optional<Finding> nodeFinding(const std::string& node, const NodeFacts& facts) {
  if (facts.gives_signs_of_life) return Finding{true, node + ": is up and has read its parameters", ""};
  if (facts.has_parameters) {
    return Finding{
        false, node + ": has parameters, but gives no sign of life",
        "read what it said when it started; was it left out on purpose, `rosparam delete " + node + "`"};
  }
  if (isOptional(node)) return std::nullopt;
  return Finding{false, node + ": is not there", "start pilot.launch, in this namespace"};
}

Finding mountingFinding(const CheckFacts& facts) {
  const std::string what = "transform base_link -> " + facts.lidar_frame + ": ";
  if (facts.mounting_problem.empty()) return {true, what + "is there", ""};
  return {false, what + facts.mounting_problem,
          "the truck's model (robot_state_publisher) or a static_transform_publisher must give it"};
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::string whoBrings(const std::string& topic) {
  if (topic == "scan") return "start the lidar, or look at its cable";
  if (topic == "command") return "see arbiter above";
  return "start can_bridge, or your own truck's node";
}

Finding topicFinding(const std::string& topic, const TopicFacts& facts, bool clock_goes) {
  if (facts.publishers.empty()) return {false, topic + ": nobody publishes it", whoBrings(topic)};
  if (facts.publishers.size() > 1) {
    return {false, topic + ": several nodes publish it: " + listed(facts.publishers), "end all but one"};
  }
  const std::string from = " from " + facts.publishers.front();
  if (facts.messages == 0) return {false, topic + ": nothing came" + from, whoBrings(topic)};
  if (!clock_goes) return {false, topic + ": its rate is not known without a clock", "see clock above"};
  const std::string rate = topic + format(": %.1f Hz", facts.rate) + from;
  if (facts.rate < kLeastRate) {
    return {false, rate, format("at least %.0f Hz are needed", kLeastRate)};
  }
  if (!(facts.age <= kPast && facts.age >= -kFuture)) {
    return {
        false,
        topic + format(": its stamps are %.2f s %s the clock", std::abs(facts.age),
                       facts.age > 0.0 ? "behind" : "ahead of"),
        "set the clocks of both machines alike (chrony, ptp), or see whether /use_sim_time is right"};
  }
  return {true, rate + format(", stamps %.2f s old", facts.age), ""};
}

Finding networkFinding(const CheckFacts& facts) {
  const auto node = facts.nodes.find("lidar_driver");
  const bool wanted = node != facts.nodes.end() && node->second.has_parameters;
  if (!facts.model.empty()) return {true, "network: " + facts.model, ""};
  if (!wanted) return {true, "network: none, preview_driver drives alone", ""};
  return {false, "network: lidar_driver proposes nothing",
          "it needs scan_filtered, odom and joint_states; see its line on /diagnostics"};
}

Finding truckFinding(const TruckStatus& truck) {
  using bridge::SafetyState;
  const auto state = static_cast<SafetyState>(truck.state);
  const std::string what = "truck: " + toString(state) + ": " + truck.reason_text;
  if (state == SafetyState::kStandby) return {true, what, "`rosservice call engage` lets it drive"};
  if (state == SafetyState::kArmed || state == SafetyState::kActive) return {true, what, ""};
  if (bridge::isStop(state)) {
    return {false, what, "remove the cause (docs/supervision.md), then `rosservice call reset`"};
  }
  if (state == SafetyState::kInit) {
    return {false, what, "the truck's controller must send its frames (docs/can.md)"};
  }
  return {false, what, "it drives slowly until the cause is gone (docs/supervision.md)"};
}

Finding stateFinding(const CheckFacts& facts) {
  if (facts.truck) return truckFinding(*facts.truck);
  if (!facts.arbiter) return {false, "truck: its state is not told", "see can_bridge and arbiter above"};
  const std::string what = "truck: " + facts.arbiter->reason_text;
  if (!facts.arbiter->stop) return {true, what, ""};
  return {false, what, "remove the cause (docs/supervision.md), then `rosservice call arbiter/reset`"};
}

}  // namespace

std::string Finding::line() const {
  return (ok ? "OK    " : "FAIL  ") + what + (advice.empty() ? "" : "; " + advice);
}

std::vector<Finding> judge(const CheckFacts& facts) {
  std::vector<Finding> findings = {clockFinding(facts)};
  const bool clock_goes = findings.front().ok;
  for (const char* node : kPilotNodes) {
    const auto found = facts.nodes.find(node);
    const auto seen = found == facts.nodes.end() ? NodeFacts{} : found->second;
    if (const auto finding = nodeFinding(node, seen)) findings.push_back(*finding);
  }
  findings.push_back(mountingFinding(facts));
  for (const char* topic : {"scan", "joint_states", "odom", "command"}) {
    const auto found = facts.topics.find(topic);
    const auto seen = found == facts.topics.end() ? TopicFacts{} : found->second;
    findings.push_back(topicFinding(topic, seen, clock_goes));
  }
  findings.push_back(networkFinding(facts));
  findings.push_back(stateFinding(facts));
  return findings;
}

bool allOk(const std::vector<Finding>& findings) {
  return std::all_of(findings.begin(), findings.end(), [](const Finding& f) { return f.ok; });
}

}  // namespace tunnel_pilot::shell
