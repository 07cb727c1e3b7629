#include "tunnel_pilot/bridge/bridge_parameters.h"

#include <cctype>

namespace tunnel_pilot::bridge {
namespace {

TrackingParameters loadTracking(config::Node node) {
  TrackingParameters p{};
  p.dead_time = node.number("dead_time", "s", 0.0, 1.0);
  p.lag = node.number("lag", "s", 0.01, 2.0);
  p.max_rate = node.number("max_rate", "rad/s", 0.01, 2.0);
  p.min_rate = node.number("min_rate", "rad/s", 0.01, p.max_rate);
  p.max_error = node.number("max_error", "rad", 0.001, 0.5);
  p.max_time = node.number("max_time", "s", 0.02, 2.0);
  node.finish();
  return p;
}

std::vector<std::string> loadHeartbeats(config::Node& node) {
  std::vector<std::string> names = node.texts("heartbeats", 0, 32);
  for (const std::string& name : names) {
    if (std::isalpha(static_cast<unsigned char>(name[0])) == 0 && name[0] != '/') {
      node.refuse("heartbeats", "holds '" + name + "', which is no name of a node");
    }
  }
  return names;
}

}  // namespace

BridgeParameters loadBridge(config::Node node) {
  BridgeParameters p{};
  p.frame_period = node.number("frame_period", "s", 0.005, 0.05);
  p.command_timeout = node.number("command_timeout", "s", 0.02, 0.25);
  p.measurement_timeout = node.number("measurement_timeout", "s", 0.05, 0.3);
  p.measurement_late = node.number("measurement_late", "s", 0.02, p.measurement_timeout);
  p.future_tolerance = node.number("future_tolerance", "s", 0.0, 0.05);
  p.feedback_timeout = node.number("feedback_timeout", "s", 0.02, 0.06);
  p.health_time = node.number("health_time", "s", 1.0, 10.0);
  p.arming_time = node.number("arming_time", "s", 0.02, 1.0);
  p.arming_timeout = node.number("arming_timeout", "s", p.arming_time, 10.0);
  p.obedience_timeout = node.number("obedience_timeout", "s", 0.05, 2.0);
  p.standstill_speed = node.number("standstill_speed", "m/s", 0.01, 0.2);
  p.standstill_time = node.number("standstill_time", "s", 0.1, 5.0);
  p.stopping_timeout = node.number("stopping_timeout", "s", 5.0, 60.0);
  p.max_speed = node.number("max_speed", "m/s", 0.1, 12.0);
  p.max_acceleration = node.number("max_acceleration", "m/s^2", 0.1, 5.0);
  p.degraded_speed = node.number("degraded_speed", "m/s", 0.1, 1.5);
  p.stop_deceleration = node.number("stop_deceleration", "m/s^2", 0.5, p.max_acceleration);
  p.steering_rate = node.number("steering_rate", "rad/s", 0.01, 0.5);
  p.max_lateral_acceleration = node.number("max_lateral_acceleration", "m/s^2", 0.1, 2.0);
  p.gyro_bias_time = node.number("gyro_bias_time", "s", 0.1, 60.0);
  p.heartbeat_timeout = node.number("heartbeat_timeout", "s", 0.04, 1.0);
  p.heartbeats = loadHeartbeats(node);
  p.tracking = loadTracking(node.child("tracking"));
  p.slip.compliance = node.number("slip_compliance", "rad s^2/m", 0.0, 0.1);
  p.slip.yaw = drivers::loadYawObserver(node.child("yaw_response"));
  p.errors = loadSensorErrors(node.child("sensor_errors"));
  p.can = can::loadProfile(node, can::Side::kPilot);
  node.finish();
  return p;
}

}  // namespace tunnel_pilot::bridge
