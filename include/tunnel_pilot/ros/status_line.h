#pragma once

#include <optional>
#include <string>

#include "tunnel_pilot/ros/status_text.h"

namespace tunnel_pilot::shell {

/// How old it is what the pilot drives on; none where it never came.
struct StatusAges {
  std::optional<double> scan;      ///< of the last scan's first beam [s]
  std::optional<double> feedback;  ///< of the last articulation measured [s]
};

/// What `status` tells in one line, in the words of describe(): state and reason, who steers with which
/// network and how sure it is, speed and what limits it, offset and heading in the tunnel, ages of scan
/// and feedback.
std::string statusLine(const StatusInput& input, const StatusAges& ages);

/// A line in the colour of its gravity, for terminals.
std::string coloured(const std::string& line, Gravity gravity);

/// Decides when a line is due: every second, and at once when the safety state, the reason or who steers
/// has changed.
class StatusPace {
 public:
  /// `now` is steady time [s].
  bool due(const StatusInput& input, double now);

 private:
  std::string told_;
  std::optional<double> told_at_;
};

}  // namespace tunnel_pilot::shell
