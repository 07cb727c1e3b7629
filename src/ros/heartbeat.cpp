#include "tunnel_pilot/ros/heartbeat.h"

#include <tunnel_pilot/Heartbeat.h>

#include <utility>

namespace tunnel_pilot::shell {
namespace {

constexpr double kBeatPeriod = 0.02;  // [s]

}  // namespace

Heartbeat::Heartbeat(ros::NodeHandle nh, std::string node)
    : node_(std::move(node)), publisher_(nh.advertise<tunnel_pilot::Heartbeat>("heartbeat", 5)) {
  timer_ =
      nh.createWallTimer(ros::WallDuration(kBeatPeriod), [this](const ros::WallTimerEvent&) { beat(); });
}

void Heartbeat::beat() {
  tunnel_pilot::Heartbeat message;
  message.node = node_;
  message.sequence = sequence_++;
  publisher_.publish(message);
}

}  // namespace tunnel_pilot::shell
