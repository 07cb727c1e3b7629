#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// Tells which of the pilot's processes gives no sign of life any more (RELIABILITY D1, D2). Each must
/// be heard at least every `timeout`; one that was never heard is silent. Signs of life are about
/// processes, not about the truck: their ages are measured by a clock that runs on whatever simulated
/// time does.
class HeartbeatWatch {
 public:
  HeartbeatWatch(const std::vector<std::string>& processes, double timeout);

  /// A sign of life received at `now`. Others than those watched do not count.
  void heard(const std::string& process, Stamp now);

  /// The first that is silent, by name; none: all live.
  std::optional<std::string> silent(Stamp now) const;

 private:
  std::map<std::string, std::optional<Stamp>> heard_;
  Stamp timeout_;
};

}  // namespace tunnel_pilot::bridge
