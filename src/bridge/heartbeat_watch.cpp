#include "tunnel_pilot/bridge/heartbeat_watch.h"

namespace tunnel_pilot::bridge {

HeartbeatWatch::HeartbeatWatch(const std::vector<std::string>& processes, double timeout)
    : timeout_(fromSeconds(timeout)) {
  for (const std::string& process : processes) heard_[process];
}

void HeartbeatWatch::heard(const std::string& process, Stamp now) {
  const auto watched = heard_.find(process);
  if (watched != heard_.end()) watched->second = now;
}

std::optional<std::string> HeartbeatWatch::silent(Stamp now) const {
  for (const auto& [process, heard] : heard_) {
    if (!heard || now - *heard > timeout_) return process;
  }
  return std::nullopt;
}

}  // namespace tunnel_pilot::bridge
