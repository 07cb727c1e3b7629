#include "tunnel_pilot/ros/preview_driver_ros.h"

#include <ros/console.h>

#include <boost/make_shared.hpp>
#include <filesystem>

#include "tunnel_pilot/drivers/preview_laws.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {
namespace {

std::unique_ptr<drivers::PathDriver> makeDriver(const ros::NodeHandle& private_nh) {
  Parameters parameters(private_nh);
  const std::string truck_file = parameters.take({"truck_file"}).text("truck_file");
  const std::string folder = std::filesystem::path(truck_file).parent_path().string();
  return drivers::makePreviewDriver(drivers::loadPreviewDriver(parameters.rest(), folder),
                                    vehicle::loadTruck(truck_file).geometry);
}

}  // namespace

PreviewDriverRos::PreviewDriverRos(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : driver_(makeDriver(private_nh)),
      publisher_(nh.advertise<Proposal>("preview_driver/proposal", 1)),
      diagnostics_(nh, private_nh, "preview_driver", [this](auto& status) { fillStatus(status); }) {
  const auto hints = ros::TransportHints().tcpNoDelay();
  state_subscriber_ = nh.subscribe("tunnel_state", 1, &PreviewDriverRos::onState, this, hints);
  centerline_subscriber_ = nh.subscribe("centerline", 1, &PreviewDriverRos::onCenterline, this, hints);
  odometry_subscriber_ = nh.subscribe("odom", 5, &PreviewDriverRos::onOdometry, this, hints);
  joint_subscriber_ = nh.subscribe("joint_states", 5, &PreviewDriverRos::onJointState, this, hints);
}

void PreviewDriverRos::onState(const TunnelState& message) {
  tunnel_.setState(toCore(message));
  propose();
}

void PreviewDriverRos::onCenterline(const nav_msgs::Path& message) {
  tunnel_.setCenterline(toCore(message.header.stamp), toCore(message));
  propose();
}

void PreviewDriverRos::onOdometry(const nav_msgs::Odometry& message) { motion_.setOdometry(message); }

void PreviewDriverRos::onJointState(const sensor_msgs::JointState& message) {
  motion_.setJointState(message);
}

void PreviewDriverRos::propose() {
  if (clock_.jumped()) {
    ROS_WARN("preview_driver: the clock jumped, starting anew");
    driver_->reset();
    motion_.reset();
  }
  const auto tunnel = tunnel_.take();
  const auto motion = motion_.motion();
  if (!tunnel) return;
  if (!motion) {
    problem_ = "no odometry or no articulation yet";
    ROS_WARN_THROTTLE(1.0, "preview_driver: %s", problem_.c_str());
    return;
  }
  const auto proposal = driver_->propose(*tunnel, *motion, nowAfter(toRos(motion->stamp)));
  problem_ = proposal.valid ? "" : "no valid proposal: " + toString(tunnel->state.reason);
  publisher_.publish(boost::make_shared<Proposal>(toRos(proposal)));
}

void PreviewDriverRos::fillStatus(Diagnostics::Status& status) const {
  if (problem_.empty()) {
    status.summary(Diagnostics::Status::OK, "proposing");
  } else {
    status.summary(Diagnostics::Status::WARN, problem_);
  }
}

}  // namespace tunnel_pilot::shell
