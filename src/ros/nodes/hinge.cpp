// A hinge to look at, where no truck gives one: publishes `joint_states` with articulation_joint,
// swinging about an angle, or held at the one that `articulation` (std_msgs/Float64 [rad]) brings.
// Parameters: ~angle [rad], ~amplitude [rad] (0: held), ~period [s].
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>

#include <cmath>
#include <exception>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell::node {
namespace {

constexpr double kTau = 6.283185307179586;
constexpr double kFullLock = 1.5;   // no truck's hinge goes farther [rad]
constexpr double kTick = 1.0 / 30;  // [s] steady time

class Hinge {
 public:
  Hinge(ros::NodeHandle nh, const ros::NodeHandle& private_nh) {
    config::Node own = Parameters(private_nh).rest();
    angle_ = own.number("angle", "rad", -kFullLock, kFullLock);
    amplitude_ = own.number("amplitude", "rad", 0.0, kFullLock);
    period_ = own.number("period", "s", 0.5, 3600.0);
    own.finish();
    publisher_ = nh.advertise<sensor_msgs::JointState>("joint_states", 5);
    subscriber_ = nh.subscribe("articulation", 1, &Hinge::onAngle, this);
    timer_ = nh.createWallTimer(ros::WallDuration(kTick), &Hinge::onTimer, this);
  }

 private:
  void onAngle(const std_msgs::Float64& message) {
    if (!(std::abs(message.data) <= kFullLock)) {
      ROS_ERROR("hinge: %g rad is no angle of a hinge", message.data);
      return;
    }
    angle_ = message.data;
    amplitude_ = 0.0;
  }

  void onTimer(const ros::WallTimerEvent&) {
    const double time = (ros::SteadyTime::now() - start_).toSec();
    sensor_msgs::JointState message;
    message.header.stamp = ros::Time::now();
    message.name = {kArticulationJoint};
    message.position = {angle_ + amplitude_ * std::sin(kTau * time / period_)};
    publisher_.publish(message);
  }

  double angle_, amplitude_, period_;
  ros::SteadyTime start_ = ros::SteadyTime::now();
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
  ros::WallTimer timer_;
};

}  // namespace

int hinge(int argc, char** argv) {
  ros::init(argc, argv, "hinge");
  const ros::NodeHandle keep_alive;  // the log ends with the last handle, before it says why
  try {
    Hinge hinge{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& e) {
    ROS_FATAL("%s", e.what());
    return 1;
  }
  return 0;
}

}  // namespace tunnel_pilot::shell::node
