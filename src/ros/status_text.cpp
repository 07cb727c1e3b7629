#include "tunnel_pilot/ros/status_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/perception/types.h"
#include "tunnel_pilot/supervision/command.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kDegrees = 57.29577951308232;

template <class... Numbers>
std::string format(const char* pattern, Numbers... numbers) {
  char line[128];
  std::snprintf(line, sizeof line, pattern, numbers...);
  return line;
}

// To hundredths, and never to "-0.00".
double rounded(double value) { return std::round(100.0 * value) / 100.0 + 0.0; }

bool isStopped(const StatusInput& input) {
  return input.truck && bridge::isStop(static_cast<bridge::SafetyState>(input.truck->state));
}

std::string stateOf(const StatusInput& input) {
  const auto standby = static_cast<std::uint8_t>(supervision::Mode::kStandby);
  const std::string mode = input.command && input.command->mode != standby
                               ? toString(static_cast<supervision::Mode>(input.command->mode))
                               : "";
  if (!input.truck) return mode;
  const auto state = toString(static_cast<bridge::SafetyState>(input.truck->state));
  return mode.empty() ? state : state + ", " + mode;
}

std::string speedOf(const StatusInput& input) {
  if (!input.odometry) return "";
  std::string speed = format("%.2f m/s", rounded(input.odometry->twist.twist.linear.x));
  if (input.command && !input.command->stop) speed += format(" of %.2f", rounded(input.command->speed));
  if (input.arbiter && !input.arbiter->limited_by.empty() && input.arbiter->limited_by != "none") {
    speed += ", limit: " + words(input.arbiter->limited_by);
  }
  return speed;
}

void addDrive(const StatusInput& input, StatusParts& out) {
  if (input.arbiter) {
    out.steered_by = words(toString(static_cast<supervision::Source>(input.arbiter->source)));
    if (std::isfinite(input.arbiter->free_distance)) {
      out.free = format("free: %.1f m, stop takes %.1f m", input.arbiter->free_distance,
                        input.arbiter->stopping_distance);
    }
  }
  if (input.network) {
    out.network =
        input.network->valid ? format("confidence %.2f", input.network->confidence) : "no proposal";
  }
  out.speed = speedOf(input);
}

void addTunnel(const TunnelState& tunnel, StatusParts& out) {
  if (!tunnel.valid) {
    out.place = "no tunnel: " + toString(static_cast<perception::TunnelReason>(tunnel.reason));
    return;
  }
  out.place = format("offset %+.2f m, heading %+.1f deg", tunnel.lateral_offset,
                     tunnel.heading_error * kDegrees);
  const double radius = 1.0 / std::max(std::abs(tunnel.curvature), 1e-6);
  out.shape = format("width %.2f m", tunnel.width);
  if (radius < 200.0)
    out.shape += format(", radius %.0f m ", radius) + (tunnel.curvature > 0 ? "left" : "right");
}

}  // namespace

std::string words(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

// The bridge's reason is that of its last change of state, the arbiter's is of now: where the arbiter
// finds something wrong, it comes first, unless the bridge stops the truck or does not hear it.
std::string reasonInWords(const StatusInput& input) {
  if (!input.truck) return input.arbiter ? input.arbiter->reason_text : "";
  const auto not_engaged = static_cast<std::uint8_t>(supervision::Reason::kNotEngaged);
  const bool finds = input.arbiter && input.arbiter->reason > not_engaged;
  const bool deaf = input.truck->state == TruckStatus::STATE_INIT;
  const bool bridges = isStopped(input) || deaf || !finds;
  return bridges ? input.truck->reason_text : input.arbiter->reason_text;
}

Gravity gravity(const StatusInput& input) {
  using bridge::SafetyState;
  if (isStopped(input)) return Gravity::kStopped;
  const auto state = input.truck ? static_cast<SafetyState>(input.truck->state) : SafetyState::kActive;
  if (input.truck && !bridge::isEngaged(state)) return Gravity::kStandby;
  if (input.arbiter && input.arbiter->stop) return Gravity::kStopped;
  const bool limited = input.arbiter && input.arbiter->reason != 0;
  const bool lost = !input.arbiter && input.tunnel && !input.tunnel->valid;
  return limited || lost || state == SafetyState::kDegraded ? Gravity::kLimited : Gravity::kNormal;
}

StatusParts partsOf(const StatusInput& input) {
  StatusParts out;
  out.state = stateOf(input);
  out.reason = reasonInWords(input);
  addDrive(input, out);
  if (input.tunnel) addTunnel(*input.tunnel, out);
  out.gravity = gravity(input);
  return out;
}

StatusText describe(const StatusInput& input) {
  const StatusParts parts = partsOf(input);
  StatusText out;
  const auto add = [&out](const std::string& name, const std::string& line) {
    if (line.empty()) return;
    out.text += (out.text.empty() ? "" : "\n") + name + line;
  };
  add("", parts.state);
  add("", parts.reason);
  add("steered by: ", parts.steered_by);
  add("network: ", parts.network);
  for (const std::string& line : {parts.speed, parts.free, parts.place, parts.shape}) add("", line);
  out.gravity = parts.gravity;
  return out;
}

}  // namespace tunnel_pilot::shell
