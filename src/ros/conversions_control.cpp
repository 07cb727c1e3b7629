#include <algorithm>
#include <limits>

#include "tunnel_pilot/ros/conversions.h"

namespace tunnel_pilot::shell {
namespace {

std::vector<geometry_msgs::Point32> toRos(const std::vector<geometry::Point>& points) {
  std::vector<geometry_msgs::Point32> message(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    message[i].x = static_cast<float>(points[i].x());
    message[i].y = static_cast<float>(points[i].y());
  }
  return message;
}

}  // namespace

supervision::Command toCore(const TruckCommand& message) {
  supervision::Command command;
  command.stamp = toCore(message.header.stamp);
  command.sequence = message.sequence;
  command.articulation_angle = message.articulation_angle;
  command.speed = message.speed;
  command.acceleration = message.acceleration;
  command.stop = message.stop;
  command.mode = static_cast<supervision::Mode>(message.mode);
  command.source = static_cast<supervision::Source>(message.source);
  command.reason = static_cast<supervision::Reason>(message.reason);
  return command;
}

TruckCommand toRos(const supervision::Command& command) {
  TruckCommand message;
  message.header.stamp = toRos(command.stamp);
  message.header.frame_id = kBaseFrame;
  message.sequence = command.sequence;
  message.articulation_angle = command.articulation_angle;
  message.speed = command.speed;
  message.acceleration = command.acceleration;
  message.stop = command.stop;
  message.mode = static_cast<std::uint8_t>(command.mode);
  message.source = static_cast<std::uint8_t>(command.source);
  message.reason = static_cast<std::uint8_t>(command.reason);
  return message;
}

ArbiterState toArbiterState(const supervision::Decision& decision) {
  ArbiterState message;
  message.header.stamp = toRos(decision.command.stamp);
  message.header.frame_id = kBaseFrame;
  message.source = static_cast<std::uint8_t>(decision.command.source);
  message.speed_source = static_cast<std::uint8_t>(decision.speed_source);
  message.reason = static_cast<std::uint8_t>(decision.command.reason);
  message.reason_text = toString(decision.command.reason);
  message.stop = decision.command.stop;
  message.speed_limit = decision.speed_limit;
  message.limited_by = toString(decision.limited_by);
  message.clearance_left = decision.clearance_left;
  message.clearance_right = decision.clearance_right;
  message.free_distance = decision.free_distance;
  message.stopping_distance = decision.stopping_distance;
  message.corridor_left = toRos(decision.corridor_left);
  message.corridor_right = toRos(decision.corridor_right);
  return message;
}

TruckStatus toRos(const bridge::BridgeStatus& status, Stamp stamp) {
  TruckStatus message;
  message.header.stamp = toRos(stamp);
  message.header.frame_id = kBaseFrame;
  message.state = static_cast<std::uint8_t>(status.state);
  message.reason = static_cast<std::uint8_t>(status.reason);
  message.reason_text = toString(status.reason);
  message.autonomy_enabled = status.autonomy_enabled;
  message.operator_enable = status.operator_enable;
  message.operator_override = status.operator_override;
  message.faults = status.faults;
  message.steering_wheel = status.steering_wheel;
  message.throttle_pedal = status.throttle_pedal;
  message.brake_pedal = status.brake_pedal;
  message.brake_pressure = status.brake_pressure;
  message.payload = status.payload;
  message.yaw_rate = status.yaw_rate;
  message.longitudinal_acceleration = status.longitudinal_acceleration;
  std::transform(status.coils.begin(), status.coils.end(), message.coils.begin(),
                 [](double coil) { return static_cast<float>(coil); });
  message.feedback_age = status.feedback_age;
  message.frames_received = status.frames_received;
  message.frames_rejected = status.frames_rejected;
  message.frames_sent = status.frames_sent;
  return message;
}

supervision::TruckState toCore(const TruckStatus& message) {
  const auto state = static_cast<bridge::SafetyState>(message.state);
  supervision::TruckState truck;
  truck.engaged = bridge::isEngaged(state);
  truck.stopping = bridge::isStop(state);
  truck.reason = static_cast<supervision::Reason>(message.reason);
  return truck;
}

}  // namespace tunnel_pilot::shell
