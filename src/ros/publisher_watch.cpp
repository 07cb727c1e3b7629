#include "tunnel_pilot/ros/publisher_watch.h"

#include <iterator>

namespace tunnel_pilot::shell {

std::string PublisherWatch::whyRefused(const std::string& publisher, ros::SteadyTime now) {
  heard_[publisher] = now;
  for (auto node = heard_.begin(); node != heard_.end();) {
    node = (now - node->second).toSec() > kMemory ? heard_.erase(node) : std::next(node);
  }
  if (heard_.size() > 1) return "more than one node publishes it, " + publisher + " is one";
  if (!pinned_.empty() && publisher != pinned_) {
    return publisher + " publishes it, which only " + pinned_ + " may";
  }
  return "";
}

}  // namespace tunnel_pilot::shell
