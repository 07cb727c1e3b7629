#pragma once

#include <ros/time.h>

#include <map>
#include <string>

namespace tunnel_pilot::shell {

/// Notices when more than one node publishes on a topic. Judged by the messages that come, not by the
/// connections: those to a node that crashed stay for long.
class PublisherWatch {
 public:
  static constexpr double kMemory = 1.0;  ///< a node counts for so long after its last message [s]

  /// To be called with each message's publisher. True when no other spoke lately.
  bool alone(const std::string& publisher, ros::SteadyTime now);

 private:
  std::map<std::string, ros::SteadyTime> heard_;
};

}  // namespace tunnel_pilot::shell
