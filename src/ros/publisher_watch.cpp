#include "tunnel_pilot/ros/publisher_watch.h"

#include <iterator>

namespace tunnel_pilot::shell {

bool PublisherWatch::alone(const std::string& publisher, ros::SteadyTime now) {
  heard_[publisher] = now;
  for (auto node = heard_.begin(); node != heard_.end();) {
    node = (now - node->second).toSec() > kMemory ? heard_.erase(node) : std::next(node);
  }
  return heard_.size() == 1;
}

}  // namespace tunnel_pilot::shell
