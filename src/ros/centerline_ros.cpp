#include "tunnel_pilot/ros/centerline_ros.h"

#include <ros/console.h>

#include <boost/make_shared.hpp>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {

CenterlineRos::CenterlineRos(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : estimator_(perception::loadCenterline(Parameters(private_nh).rest())),
      path_publisher_(nh.advertise<nav_msgs::Path>("centerline", 1)),
      state_publisher_(nh.advertise<TunnelState>("tunnel_state", 1)),
      odometry_subscriber_(
          nh.subscribe("odom", 5, &CenterlineRos::onOdometry, this, ros::TransportHints().tcpNoDelay())),
      walls_subscriber_(
          nh.subscribe("walls", 1, &CenterlineRos::onWalls, this, ros::TransportHints().tcpNoDelay())),
      diagnostics_(nh, private_nh, "centerline", [this](auto& status) { fillStatus(status); }) {}

void CenterlineRos::checkClock() {
  if (!clock_.jumped()) return;
  ROS_WARN("centerline: the clock jumped, starting anew");
  estimator_.reset();
  odometry_.clear();
}

void CenterlineRos::onOdometry(const nav_msgs::Odometry& message) {
  checkClock();
  odometry_.add(toMotion(message), now());
}

void CenterlineRos::onWalls(const Walls& message) {
  checkClock();
  const Stamp stamp = toCore(message.header.stamp);
  const auto& tunnel = estimator_.update(toCore(message), odometry_.poseAt(stamp));
  last_ = tunnel.state;
  ++(last_.valid ? valid_ : invalid_);
  path_publisher_.publish(boost::make_shared<nav_msgs::Path>(toRos(tunnel.centerline, stamp)));
  state_publisher_.publish(boost::make_shared<TunnelState>(toRos(tunnel.state)));
}

void CenterlineRos::fillStatus(Diagnostics::Status& status) const {
  if (last_.valid) {
    status.summary(Diagnostics::Status::OK, "in the tunnel");
  } else {
    status.summary(Diagnostics::Status::ERROR, toString(last_.reason));
  }
  status.add("valid", valid_);
  status.add("invalid", invalid_);
  status.add("odometry", odometry_.empty() ? "none" : "present");
}

}  // namespace tunnel_pilot::shell
