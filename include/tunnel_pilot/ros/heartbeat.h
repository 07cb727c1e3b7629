#pragma once

#include <ros/node_handle.h>

#include <cstdint>
#include <string>

namespace tunnel_pilot::shell {

/// Publishes `heartbeat` (Heartbeat.msg) every 20 ms of steady time, in the callback queue of `nh`: that
/// of the stage it speaks for, so that a stage that hangs or whose process is dead falls silent.
class Heartbeat {
 public:
  /// `node` is the resolved name of the node or nodelet.
  Heartbeat(ros::NodeHandle nh, std::string node);

 private:
  void beat();

  std::string node_;
  std::uint32_t sequence_ = 0;
  ros::Publisher publisher_;
  ros::WallTimer timer_;
};

}  // namespace tunnel_pilot::shell
