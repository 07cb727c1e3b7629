#include "tunnel_pilot/rviz/hud_content.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <tuple>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/perception/types.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/status_text.h"
#include "tunnel_pilot/supervision/command.h"

namespace tunnel_pilot::hud {
namespace {

constexpr double kDegrees = 57.29577951308232;
// More than any age of a healthy drive, less than an operator could be misled by.
constexpr double kAgedAfter = 0.5, kLostAfter = 2.0;  // [s] ROS time
// Longer: a simulator may be slower than real time, and rviz' own window may be held up.
constexpr double kAgedAfterSteady = 1.0, kLostAfterSteady = 4.0;  // [s] steady time
constexpr double kFuture = 0.05;  // of a stamp that is still believed [s]
// Ages above are told in colour; a scan older than the second stops the truck (config/arbiter.yaml).
constexpr double kLate = 0.10, kTooLate = 0.30;  // [s]
// Full scales of the bars.
constexpr double kSpeedScale = 10.0;                    // [m/s]
constexpr double kArticulationScale = 45.0 / kDegrees;  // [rad]
constexpr double kLateralScale = 1.0;                   // [m]
constexpr double kHeadingScale = 10.0 / kDegrees;       // [rad]
constexpr double kSteps = 100.0;                        // of a bar's length, that can be told apart
constexpr std::size_t kHashDigits = 12;

const Text kNoData{"no data", Tone::kStale};
const Text kNoCommand{"no command", Tone::kStale};

template <class... Numbers>
std::string format(const char* pattern, Numbers... numbers) {
  char line[128];
  std::snprintf(line, sizeof line, pattern, numbers...);
  return line;
}

// To that many decimals, and never to "-0.00".
std::string number(const char* pattern, double value, double per_unit) {
  return format(pattern, std::round(per_unit * value) / per_unit + 0.0);
}

std::string degrees(double angle) { return number("%+.1f°", angle * kDegrees, 10.0); }

std::optional<double> share(double value, double scale) {
  if (!std::isfinite(value)) return {};
  return std::round(kSteps * std::clamp(value / scale, -1.0, 1.0)) / kSteps + 0.0;
}

// Fresh words keep their tone, aged ones lose it, lost ones are not told.
Text told(Freshness freshness, const Text& words) {
  if (freshness == Freshness::kLost) return kNoData;
  return {words.text, freshness == Freshness::kAged ? Tone::kStale : words.tone};
}

Tone toned(Freshness freshness, Tone tone) {
  return freshness == Freshness::kFresh ? tone : Tone::kStale;
}

Tone tone(shell::Gravity gravity) {
  switch (gravity) {
    case shell::Gravity::kStandby:
      return Tone::kStandby;
    case shell::Gravity::kLimited:
      return Tone::kCaution;
    case shell::Gravity::kStopped:
      return Tone::kAlarm;
    case shell::Gravity::kNormal:
      break;
  }
  return Tone::kGood;
}

template <class Message>
std::optional<Message> unlessLost(const Heard<Message>& heard, Freshness freshness) {
  return freshness == Freshness::kLost ? std::nullopt : std::optional(heard.message());
}

std::string modeInWords(const TruckCommand& command) {
  return toString(static_cast<supervision::Mode>(command.mode));
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return std::toupper(c); });
  return text;
}

// A truck that has never told its state has no bridge of ours: the command's mode stands for it.
void addState(const HudInput& input, const Moment& now, HudContent& out) {
  const auto truck = input.truck.measured(now);
  const auto arbiter = input.arbiter.spoken(now);
  const auto command = input.command.spoken(now);
  shell::StatusInput status;
  status.truck = unlessLost(input.truck, truck);
  status.arbiter = unlessLost(input.arbiter, arbiter);
  const Tone grave = tone(shell::gravity(status));
  if (command != Freshness::kLost) {
    out.mode = told(command, {modeInWords(input.command.message()), Tone::kNormal});
  }
  if (status.truck) {
    const auto state = static_cast<bridge::SafetyState>(status.truck->state);
    out.state = told(truck, {toString(state), grave});
  } else if (!input.truck.any() && status.arbiter && command != Freshness::kLost) {
    out.state = told(std::max(arbiter, command), {upper(out.mode.text), grave});
    out.mode.text.clear();
  } else {
    out.state = {"NO DATA", Tone::kStale};
  }
  const bool known = status.truck || status.arbiter;
  out.reason = {known ? shell::reasonInWords(status) : "nothing is heard of the pilot",
                std::min(truck, arbiter) == Freshness::kFresh ? grave : Tone::kStale};
}

void addSource(const HudInput& input, const Moment& now, HudContent& out) {
  out.source = kNoData;
  if (!input.arbiter.any()) return;
  const auto source = static_cast<supervision::Source>(input.arbiter.message().source);
  out.source = told(input.arbiter.spoken(now), {shell::words(toString(source)), Tone::kNormal});
}

void addSpeed(const HudInput& input, const Moment& now, HudContent& out) {
  const auto motion = input.odometry.measured(now);
  const auto command = input.command.spoken(now);
  const auto arbiter = input.arbiter.spoken(now);
  out.speed = kNoData;
  out.asked_speed = kNoCommand;
  if (motion != Freshness::kLost) {
    const double speed = input.odometry.message().twist.twist.linear.x;
    out.speed = told(motion, {number("%.2f m/s", speed, 100.0), Tone::kNormal});
    out.speed_gauge.value = share(std::abs(speed), kSpeedScale);
    out.speed_gauge.tone = toned(motion, Tone::kGood);
  }
  if (command != Freshness::kLost) {
    const double speed = input.command.message().speed;
    out.asked_speed = told(command, {number("asked %.2f m/s", speed, 100.0), Tone::kNormal});
    out.speed_gauge.mark = share(speed, kSpeedScale);
  }
  if (arbiter == Freshness::kLost) return;
  const ArbiterState& state = input.arbiter.message();
  out.speed_limit = told(arbiter, {number("limit %.2f", state.speed_limit, 100.0), Tone::kNormal});
  const bool is_limited = !state.limited_by.empty() && state.limited_by != "none";
  out.limited_by =
      told(arbiter, {is_limited ? "by " + shell::words(state.limited_by) : "", Tone::kNormal});
}

std::optional<double> articulationOf(const sensor_msgs::JointState& joints) {
  for (std::size_t i = 0; i < std::min(joints.name.size(), joints.position.size()); ++i) {
    if (joints.name[i] == shell::kArticulationJoint) return joints.position[i];
  }
  return {};
}

void addArticulation(const HudInput& input, const Moment& now, HudContent& out) {
  const auto motion = input.joints.measured(now);
  const auto command = input.command.spoken(now);
  out.articulation = kNoData;
  out.commanded = kNoCommand;
  if (motion != Freshness::kLost) {
    if (const auto angle = articulationOf(input.joints.message())) {
      out.articulation = told(motion, {degrees(*angle), Tone::kNormal});
      out.articulation_gauge.value = share(*angle, kArticulationScale);
      out.articulation_gauge.tone = toned(motion, Tone::kGood);
    }
  }
  if (command == Freshness::kLost) return;
  const double angle = input.command.message().articulation_angle;
  out.commanded = told(command, {"asked " + degrees(angle), Tone::kNormal});
  out.articulation_gauge.mark = share(angle, kArticulationScale);
}

void addTunnel(const HudInput& input, const Moment& now, HudContent& out) {
  const auto measured = input.tunnel.measured(now);
  out.lateral = out.heading = kNoData;
  if (measured == Freshness::kLost) return;
  const TunnelState& tunnel = input.tunnel.message();
  if (!tunnel.valid) {
    const std::string why = toString(static_cast<perception::TunnelReason>(tunnel.reason));
    out.no_tunnel = told(measured, {"no tunnel: " + why, Tone::kCaution});
    return;
  }
  out.lateral = told(measured, {number("%+.2f m", tunnel.lateral_offset, 100.0), Tone::kNormal});
  out.heading = told(measured, {degrees(tunnel.heading_error), Tone::kNormal});
  const Tone tone = toned(measured, Tone::kGood);
  out.lateral_gauge = {share(tunnel.lateral_offset, kLateralScale), {}, tone};
  out.heading_gauge = {share(tunnel.heading_error, kHeadingScale), {}, tone};
}

// The name, and the digits of the hash that tell networks apart.
void addModel(const std::string& model, Freshness measured, HudContent& out) {
  const auto space = model.find(' ');
  out.model = told(measured, {model.substr(0, space), Tone::kNormal});
  if (space == std::string::npos) return;
  out.hash = told(measured, {model.substr(space + 1, kHashDigits), Tone::kNormal});
}

void addOutputs(const Proposal& network, HudContent& out) {
  for (const float output : network.outputs) {
    out.outputs.push_back(share(std::max(0.0F, output), 1.0).value_or(0.0));
  }
}

// Where an articulation stands among the outputs: -1 the first, 1 the last.
std::optional<double> amongOutputs(double angle, const Proposal& network) {
  const double half =
      0.5 * network.outputs_spacing * (static_cast<double>(network.outputs.size()) - 1.0);
  if (!(half > 0.0)) return {};
  return share(angle - network.outputs_first - half, half);
}

void addNetwork(const HudInput& input, const Moment& now, HudContent& out) {
  const auto measured = input.network.measured(now);
  out.network_angle = kNoData;
  if (measured == Freshness::kLost) return;
  const Proposal& network = input.network.message();
  addOutputs(network, out);
  addModel(network.model, measured, out);
  out.network_gauge.tone = toned(measured, Tone::kGood);
  const auto preview = input.preview.measured(now);
  if (preview == Freshness::kFresh && input.preview.message().valid) {
    out.network_gauge.mark = amongOutputs(input.preview.message().articulation_angle, network);
  }
  if (!network.valid) {
    out.network_angle = told(measured, {"no proposal", Tone::kCaution});
    return;
  }
  out.network_angle = told(measured, {degrees(network.articulation_angle), Tone::kNormal});
  out.confidence = told(measured, {number("confidence %.2f", network.confidence, 100.0), Tone::kNormal});
  out.network_gauge.value = amongOutputs(network.articulation_angle, network);
}

template <class Message>
Text ageInWords(const Heard<Message>& heard, const Moment& now) {
  if (!heard.any()) return kNoData;
  const double steady = heard.steadySilence(now);
  const double age = heard.age(now);
  if (age < -kFuture) return {format("%.1f s", age), Tone::kAlarm};  // the clocks do not agree
  // Where time stands still, nothing ages by it.
  const double older = steady > kAgedAfterSteady ? std::max(steady, age) : age;
  const Tone tone = older > kTooLate ? Tone::kAlarm : older > kLate ? Tone::kCaution : Tone::kNormal;
  if (older <= kLate) return {"< 0.1 s", tone};
  return {older < 10.0 ? format("%.1f s", older) : format("%.0f s", std::min(older, 999.0)), tone};
}

auto texts(const HudContent& c) {
  return std::tie(c.state, c.mode, c.reason, c.source, c.speed, c.asked_speed, c.limited_by,
                  c.speed_limit, c.articulation, c.commanded, c.lateral, c.heading, c.no_tunnel,
                  c.network_angle, c.confidence, c.model, c.hash, c.scan_age, c.feedback_age);
}

auto gauges(const HudContent& c) {
  return std::tie(c.speed_gauge, c.articulation_gauge, c.lateral_gauge, c.heading_gauge, c.network_gauge,
                  c.outputs);
}

}  // namespace

Freshness freshness(double age, double silence, double steady_silence) {
  if (!(age >= -kFuture && silence >= 0.0)) return Freshness::kLost;  // the clock jumped, or is another
  const double oldest = std::max(age, silence);
  if (oldest > kLostAfter || steady_silence > kLostAfterSteady) return Freshness::kLost;
  return oldest > kAgedAfter || steady_silence > kAgedAfterSteady ? Freshness::kAged : Freshness::kFresh;
}

bool operator==(const Text& a, const Text& b) { return a.text == b.text && a.tone == b.tone; }

bool operator==(const Gauge& a, const Gauge& b) {
  return a.value == b.value && a.mark == b.mark && a.tone == b.tone;
}

bool operator==(const HudContent& a, const HudContent& b) {
  return texts(a) == texts(b) && gauges(a) == gauges(b);
}

HudContent describeHud(const HudInput& input, const Moment& now) {
  HudContent out;
  addState(input, now, out);
  addSource(input, now, out);
  addSpeed(input, now, out);
  addArticulation(input, now, out);
  addTunnel(input, now, out);
  addNetwork(input, now, out);
  out.scan_age = ageInWords(input.tunnel, now);
  out.feedback_age = ageInWords(input.joints, now);
  return out;
}

}  // namespace tunnel_pilot::hud
