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

void add(const std::string& line, StatusText& out) {
  if (!out.text.empty()) out.text += '\n';
  out.text += line;
}

bool isStopped(const StatusInput& input) {
  return input.truck && bridge::isStop(static_cast<bridge::SafetyState>(input.truck->state));
}

void addState(const StatusInput& input, StatusText& out) {
  const auto standby = static_cast<std::uint8_t>(supervision::Mode::kStandby);
  const std::string mode = input.command && input.command->mode != standby
                               ? toString(static_cast<supervision::Mode>(input.command->mode))
                               : "";
  if (input.truck) {
    const auto state = toString(static_cast<bridge::SafetyState>(input.truck->state));
    add(mode.empty() ? state : state + ", " + mode, out);
  } else if (!mode.empty()) {
    add(mode, out);
  }
  if (const auto why = reasonInWords(input); !why.empty()) add(why, out);
}

void addDrive(const StatusInput& input, StatusText& out) {
  if (input.arbiter) {
    add("steered by: " + words(toString(static_cast<supervision::Source>(input.arbiter->source))), out);
  }
  if (input.network) {
    add(input.network->valid ? format("network: confidence %.2f", input.network->confidence)
                             : "network: no proposal",
        out);
  }
  if (input.odometry) {
    std::string speed = format("%.2f m/s", rounded(input.odometry->twist.twist.linear.x));
    if (input.command && !input.command->stop)
      speed += format(" of %.2f", rounded(input.command->speed));
    if (input.arbiter && !input.arbiter->limited_by.empty() && input.arbiter->limited_by != "none") {
      speed += ", limit: " + words(input.arbiter->limited_by);
    }
    add(speed, out);
  }
  if (input.arbiter && std::isfinite(input.arbiter->free_distance)) {
    add(format("free: %.1f m, stop takes %.1f m", input.arbiter->free_distance,
               input.arbiter->stopping_distance),
        out);
  }
}

void addTunnel(const TunnelState& tunnel, StatusText& out) {
  if (!tunnel.valid) {
    add("no tunnel: " + toString(static_cast<perception::TunnelReason>(tunnel.reason)), out);
    return;
  }
  add(format("offset %+.2f m, heading %+.1f deg", tunnel.lateral_offset,
             tunnel.heading_error * kDegrees),
      out);
  const double radius = 1.0 / std::max(std::abs(tunnel.curvature), 1e-6);
  std::string shape = format("width %.2f m", tunnel.width);
  if (radius < 200.0)
    shape += format(", radius %.0f m ", radius) + (tunnel.curvature > 0 ? "left" : "right");
  add(shape, out);
}

}  // namespace

std::string words(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

std::string reasonInWords(const StatusInput& input) {
  const bool bridges = input.truck && (isStopped(input) || !input.arbiter);
  return bridges ? input.truck->reason_text : input.arbiter ? input.arbiter->reason_text : "";
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

StatusText describe(const StatusInput& input) {
  StatusText out;
  addState(input, out);
  addDrive(input, out);
  if (input.tunnel) addTunnel(*input.tunnel, out);
  out.gravity = gravity(input);
  return out;
}

}  // namespace tunnel_pilot::shell
