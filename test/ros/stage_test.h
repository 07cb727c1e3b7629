#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace tunnel_pilot::shell {

/// Keeps the last messages of a topic.
template <class Message>
class Listener {
 public:
  Listener(ros::NodeHandle& nh, const std::string& topic)
      : subscriber_(nh.subscribe<Message>(
            topic, 100, [this](const typename Message::ConstPtr& m) { messages.push_back(*m); })) {}

  bool has(ros::Time stamp) const {
    for (const auto& message : messages) {
      if (message.header.stamp == stamp) return true;
    }
    return false;
  }

  bool connected() const { return subscriber_.getNumPublishers() > 0; }

  std::vector<Message> messages;

 private:
  ros::Subscriber subscriber_;
};

/// Publishes by pointer: only so do messages on different topics reach a nodelet in their order.
template <class Message>
void send(const ros::Publisher& publisher, const Message& message) {
  publisher.publish(boost::make_shared<Message>(message));
}

/// Runs nodelets in this process, found and loaded as a manager does it, under a clock that the test
/// sets. Their parameters are those that the .test file loaded under their names.
class StageTest : public ::testing::Test {
 protected:
  StageTest() : loader_(ros::NodeHandle("~loader")) { setTime(1000.0); }
  ~StageTest() override { loader_.clear(); }

  bool load(const std::string& name, const std::string& type) {
    return loader_.load(ros::names::resolve(name), "tunnel_pilot/" + type, {}, {});
  }

  void setTime(double seconds) { ros::Time::setNow(ros::Time(seconds)); }

  /// Serves callbacks until `done`, at most `seconds` of steady time. Returns done().
  static bool spinUntil(const std::function<bool()>& done, double seconds = 5.0) {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(seconds);
    while (!done() && ros::SteadyTime::now() < end) {
      ros::spinOnce();
      ros::WallDuration(0.001).sleep();
    }
    return done();
  }

  /// Waits until the diagnostics of `stage` say (message or values) what is asked for.
  bool diagnosticsSay(const std::string& stage, const std::string& text) {
    Listener<diagnostic_msgs::DiagnosticArray> diagnostics(nh_, "/diagnostics");
    return spinUntil([&] { return saysIn(diagnostics.messages, stage, text); });
  }

  ros::NodeHandle nh_;

 private:
  static bool saysIn(const std::vector<diagnostic_msgs::DiagnosticArray>& messages,
                     const std::string& stage, const std::string& text) {
    for (const auto& message : messages) {
      for (const auto& status : message.status) {
        if (status.name.find(stage) == std::string::npos) continue;
        if (status.message.find(text) != std::string::npos) return true;
        for (const auto& value : status.values) {
          if (value.key.find(text) != std::string::npos) return true;
        }
      }
    }
    return false;
  }

  nodelet::Loader loader_;
};

/// A scan of a straight tunnel 5.0 m wide, from its middle, by the truck's own lidar.
inline sensor_msgs::LaserScan tunnelScan(double stamp) {
  sensor_msgs::LaserScan scan;
  scan.header.stamp = ros::Time(stamp);
  scan.header.frame_id = "laser";
  scan.angle_min = static_cast<float>(-95.0 * M_PI / 180.0);
  scan.angle_increment = static_cast<float>(0.25 * M_PI / 180.0);
  scan.angle_max = scan.angle_min + 760.0F * scan.angle_increment;
  scan.range_min = 0.1F;
  scan.range_max = 40.0F;
  for (int i = 0; i < 761; ++i) {
    const double angle = scan.angle_min + i * static_cast<double>(scan.angle_increment);
    // No two scans are alike: a frozen sensor is another matter.
    const double range = 2.5 / std::abs(std::sin(angle)) + 1e-3 * std::sin(i + 1e3 * stamp);
    scan.ranges.push_back(range < 40.0 ? static_cast<float>(range)
                                       : std::numeric_limits<float>::infinity());
  }
  return scan;
}

inline nav_msgs::Odometry odometryAt(double stamp, double speed) {
  nav_msgs::Odometry odometry;
  odometry.header.stamp = ros::Time(stamp);
  odometry.header.frame_id = "odom";
  odometry.pose.pose.position.x = speed * (stamp - 1000.0);
  odometry.pose.pose.orientation.w = 1.0;
  odometry.twist.twist.linear.x = speed;
  return odometry;
}

inline sensor_msgs::JointState jointStateAt(double stamp, double angle) {
  sensor_msgs::JointState joints;
  joints.header.stamp = ros::Time(stamp);
  joints.name = {"articulation_joint"};
  joints.position = {angle};
  joints.velocity = {0.0};
  return joints;
}

}  // namespace tunnel_pilot::shell
