#include <map>
#include <string>

#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::supervision {
namespace {

const std::map<std::string, Source>& sourcesByName() {
  static const std::map<std::string, Source> sources = [] {
    std::map<std::string, Source> by_name;
    for (const Source source : {Source::kLidarDriver, Source::kPreviewDriver, Source::kWireDriver,
                                Source::kLaneKeeper, Source::kSharedControl, Source::kTeleoperation}) {
      by_name.emplace(toString(source), source);
    }
    return by_name;
  }();
  return sources;
}

SourceRule loadRule(config::Node node) {
  std::vector<std::string> names;
  for (const auto& [name, source] : sourcesByName()) names.push_back(name);
  SourceRule rule{};
  rule.source = sourcesByName().at(node.choice("source", names));
  rule.priority = static_cast<int>(node.integer("priority", "1", 0, 255));
  rule.max_age = node.number("max_age", "s", 0.02, 1.0);
  rule.min_confidence = node.number("min_confidence", "1", 0.0, 1.0);
  rule.steers = node.boolean("steers");
  rule.gives_speed = node.boolean("gives_speed");
  node.finish();
  return rule;
}

std::vector<SourceRule> loadRules(config::Node& node) {
  std::vector<SourceRule> rules;
  for (config::Node& row : node.children("sources")) {
    const SourceRule rule = loadRule(row);
    for (const SourceRule& other : rules) {
      if (other.source == rule.source) row.refuse("source", "stands twice in the table");
      if (other.priority == rule.priority) row.refuse("priority", "must differ from the others'");
    }
    rules.push_back(rule);
  }
  if (rules.empty()) node.refuse("sources", "must have at least one row");
  return rules;
}

}  // namespace

ArbiterParameters loadArbiter(config::Node node) {
  ArbiterParameters p{};
  p.sources = loadRules(node);
  p.needs_truck_state = node.boolean("needs_truck_state");
  p.wall_checks = node.boolean("wall_checks");
  config::Node ages = node.child("ages");
  p.max_stamp_age = ages.number("max_stamp", "s", 0.05, 1.0);
  p.max_future = ages.number("max_future", "s", 0.0, 0.5);
  p.scan_degraded_age = ages.number("scan_degraded", "s", 0.05, 1.0);
  p.scan_stop_age = ages.number("scan_stop", "s", p.scan_degraded_age, 1.0);
  p.motion_stop_age = ages.number("motion_stop", "s", 0.02, 1.0);
  p.truck_state_stop_age = ages.number("truck_state_stop", "s", 0.02, 1.0);
  p.tunnel_grace = ages.number("tunnel_grace", "s", 0.0, 2.0);
  p.dead_reckoning_age = ages.number("dead_reckoning", "s", 0.5, 20.0);
  p.clock_jump = ages.number("clock_jump", "s", 0.1, 10.0);
  ages.finish();
  config::Node degraded = node.child("degraded");
  p.degraded_speed = degraded.number("speed", "m/s", 0.1, 5.0);
  p.recovery_time = degraded.number("recovery_time", "s", 0.1, 10.0);
  p.limit_hits = static_cast<int>(degraded.integer("limit_hits", "1", 1, 100));
  degraded.finish();
  config::Node tracking = node.child("tracking");
  p.tracking_tolerance = tracking.number("tolerance", "rad", 0.01, 1.0);
  p.tracking_time = tracking.number("time", "s", 0.05, 5.0);
  tracking.finish();
  config::Node disagreement = node.child("disagreement");
  p.disagreement_angle = disagreement.number("angle", "rad", 0.01, 1.0);
  p.disagreement_time = disagreement.number("time", "s", 0.0, 5.0);
  disagreement.finish();
  p.obstacle_scans = static_cast<int>(node.integer("obstacle_scans", "1", 1, 10));
  p.wall_scans = static_cast<int>(node.integer("wall_scans", "1", p.obstacle_scans, 35));
  p.governor = loadSpeedGovernor(node.child("governor"));
  p.yaw = drivers::loadYawObserver(node.child("yaw_response"));
  p.envelope = loadEnvelope(node.child("envelope"));
  p.limiter = loadCommandLimiter(node.child("limiter"));
  node.finish();
  return p;
}

}  // namespace tunnel_pilot::supervision
