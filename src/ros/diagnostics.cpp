#include "tunnel_pilot/ros/diagnostics.h"

#include <utility>

namespace tunnel_pilot::shell {
namespace {

constexpr double kTellingPeriod = 0.25;  // [s] steady time

}  // namespace

Diagnostics::Diagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                         const std::string& stage, std::function<void(Status&)> fill)
    : updater_(nh, private_nh, private_nh.getNamespace()) {
  updater_.setHardwareID("none");
  updater_.add(stage, [fill = std::move(fill)](Status& status) { fill(status); });
  timer_ = nh.createWallTimer(ros::WallDuration(kTellingPeriod),
                              [this](const ros::WallTimerEvent&) { updater_.force_update(); });
}

}  // namespace tunnel_pilot::shell
