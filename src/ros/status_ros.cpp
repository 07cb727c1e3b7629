#include "tunnel_pilot/ros/status_ros.h"

#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <utility>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kTick = 0.05;   // [s] steady time
constexpr double kSilent = 1.0;  // what is older is not told any more [s]

// In the core's stamps: ros::Time throws where two are more than 68 years apart, and a message may say
// anything.
std::optional<double> ageOf(const std::optional<ros::Time>& stamp) {
  if (!stamp) return std::nullopt;
  return std::max(0.0, toSeconds(now() - shell::toCore(*stamp)));
}

}  // namespace

StatusRos::StatusRos(ros::NodeHandle nh, ros::NodeHandle private_nh, Tell tell)
    : nh_(nh), tell_(std::move(tell)) {
  Parameters(private_nh).rest().finish();
  listen(nh, "truck_status", truck_status_);
  listen(nh, "arbiter_state", arbiter_state_);
  listen(nh, "command", command_);
  listen(nh, "tunnel_state", tunnel_state_);
  listen(nh, "odom", odometry_);
  listen(nh, "lidar_driver/proposal", network_);
  const boost::function<void(const sensor_msgs::LaserScan&)> on_scan = [this](const auto& message) {
    scan_ = message.header.stamp;
  };
  const boost::function<void(const sensor_msgs::JointState&)> on_joints = [this](const auto& message) {
    feedback_ = message.header.stamp;
  };
  subscribers_.push_back(nh.subscribe<sensor_msgs::LaserScan>("scan", 1, on_scan));
  subscribers_.push_back(nh.subscribe<sensor_msgs::JointState>("joint_states", 1, on_joints));
  timer_ = nh.createWallTimer(ros::WallDuration(kTick), [this](const ros::WallTimerEvent&) {
    followClock();
    update();
  });
}

template <class Message>
void StatusRos::listen(ros::NodeHandle& nh, const std::string& topic, Latest<Message>& latest) {
  const boost::function<void(const Message&)> take = [this, &latest](const Message& message) {
    latest.set(message);
    update();
  };
  subscribers_.push_back(nh.subscribe<Message>(topic, 5, take));
}

// roscpp looks at /use_sim_time when a node starts, and never again.
void StatusRos::followClock() {
  bool simulated = false;
  if (ros::Time::isSimTime() || clock_subscriber_) return;
  if (!nh_.getParamCached("/use_sim_time", simulated) || !simulated) return;
  const boost::function<void(const rosgraph_msgs::Clock&)> on_clock = [](const auto& message) {
    ros::Time::setNow(message.clock);
  };
  clock_subscriber_ = nh_.subscribe<rosgraph_msgs::Clock>("/clock", 1, on_clock);
}

StatusInput StatusRos::input() const {
  return {truck_status_.get(kSilent), arbiter_state_.get(kSilent), command_.get(kSilent),
          tunnel_state_.get(kSilent), odometry_.get(kSilent),      network_.get(kSilent)};
}

void StatusRos::update() {
  const StatusInput known = input();
  if (!pace_.due(known, ros::SteadyTime::now().toSec())) return;
  const bool heard = known.truck || known.arbiter;
  tell_(statusLine(known, {ageOf(scan_), ageOf(feedback_)}),
        heard ? partsOf(known).gravity : Gravity::kLimited);
}

}  // namespace tunnel_pilot::shell
