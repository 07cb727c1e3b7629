#include "tunnel_pilot/ros/status_line.h"

#include <cstdio>

namespace tunnel_pilot::shell {
namespace {

constexpr double kLinePeriod = 1.0;      // [s]
constexpr std::size_t kHashDigits = 12;  // shown of a SHA-256

void add(const std::string& part, const char* separator, std::string& line) {
  if (part.empty()) return;
  line += (line.empty() ? "" : separator) + part;
}

// "lidar_driver 0123456789ab": a network's name and the beginning of its hash.
std::string shortModel(const std::string& model) {
  const std::size_t hash = model.rfind(' ');
  return hash == std::string::npos ? model : model.substr(0, hash + 1 + kHashDigits);
}

std::string driverOf(const StatusInput& input, const StatusParts& parts) {
  std::string text = parts.steered_by;
  if (!input.network) return text;
  const bool named = !input.network->model.empty();
  add("network " + (named ? shortModel(input.network->model) + " " : "") + parts.network, ", ", text);
  return text;
}

std::string age(const char* what, const std::optional<double>& seconds) {
  if (!seconds) return std::string("no ") + what;
  char text[48];
  std::snprintf(text, sizeof text, "%s %.2f s old", what, *seconds);
  return text;
}

}  // namespace

std::string statusLine(const StatusInput& input, const StatusAges& ages) {
  const StatusParts parts = partsOf(input);
  std::string line = parts.state;
  add(parts.reason, ": ", line);
  if (line.empty()) line = "no pilot is heard";
  add(driverOf(input, parts), " | ", line);
  add(parts.speed, " | ", line);
  add(parts.place, " | ", line);
  add(age("scan", ages.scan) + ", " + age("feedback", ages.feedback), " | ", line);
  return line;
}

std::string coloured(const std::string& line, Gravity gravity) {
  const char* colour = gravity == Gravity::kNormal    ? "\033[32m"   // green
                       : gravity == Gravity::kStandby ? "\033[36m"   // cyan
                       : gravity == Gravity::kLimited ? "\033[33m"   // yellow
                                                      : "\033[31m";  // red
  return colour + line + "\033[0m";
}

bool StatusPace::due(const StatusInput& input, double now) {
  const StatusParts parts = partsOf(input);
  const std::string key = parts.state + "\n" + parts.reason + "\n" + parts.steered_by;
  if (!told_at_) {  // nothing is known yet: that is told when it stays so
    told_ = "\n\n";
    told_at_ = now;
  }
  if (key == told_ && now - *told_at_ < kLinePeriod) return false;
  told_ = key;
  told_at_ = now;
  return true;
}

}  // namespace tunnel_pilot::shell
