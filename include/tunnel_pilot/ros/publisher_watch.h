#pragma once

#include <ros/time.h>

#include <map>
#include <string>
#include <utility>

namespace tunnel_pilot::shell {

/// Notices when more than one node publishes on a topic, or another one than it should be. Judged by the
/// messages that come, not by the connections: those to a node that crashed stay for long.
class PublisherWatch {
 public:
  static constexpr double kMemory = 1.0;  ///< a node counts for so long after its last message [s]

  /// `pinned` is the resolved name of the only node that may publish; empty: any one.
  explicit PublisherWatch(std::string pinned = "") : pinned_(std::move(pinned)) {}

  /// To be called with each message's publisher. Why the message must be refused; empty: it need not be.
  std::string whyRefused(const std::string& publisher, ros::SteadyTime now);

 private:
  std::string pinned_;
  std::map<std::string, ros::SteadyTime> heard_;
};

}  // namespace tunnel_pilot::shell
