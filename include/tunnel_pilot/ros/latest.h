#pragma once

#include <ros/time.h>

#include <optional>

namespace tunnel_pilot::shell {

/// The latest message of a topic and when it came. What came is silent only once it is old by ROS time,
/// which may stand still, and by steady time: simulated time may run fast, or leap when a busy machine
/// holds this process up.
template <class Message>
class Latest {
 public:
  void set(const Message& message) {
    message_ = message;
    received_ = ros::Time::now();
    received_steady_ = ros::SteadyTime::now();
  }
  /// Empty when none came within the last `max_age` [s], or when the clock went back since.
  std::optional<Message> get(double max_age) const {
    if (!message_) return {};
    const double age = (ros::Time::now() - received_).toSec();
    const double steady_age = (ros::SteadyTime::now() - received_steady_).toSec();
    return age >= 0.0 && (age <= max_age || steady_age <= max_age) ? message_ : std::nullopt;
  }

 private:
  std::optional<Message> message_;
  ros::Time received_;
  ros::SteadyTime received_steady_;
};

}  // namespace tunnel_pilot::shell
