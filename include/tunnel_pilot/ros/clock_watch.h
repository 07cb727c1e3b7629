#pragma once

#include <ros/time.h>

namespace tunnel_pilot::shell {

/// Notices when ROS time does not flow: what was measured before a jump must not be used after it.
/// In simulated time a jump is any step back and any step ahead of more than kLargestStep between two
/// calls. Otherwise it is any difference of more than kLargestDrift between the progress of the system's
/// clock and of the steady one. Time that has not begun (zero) is no time.
class ClockWatch {
 public:
  static constexpr double kLargestStep = 1.0;   ///< [s]
  static constexpr double kLargestDrift = 0.1;  ///< [s]

  /// True when time jumped since the last call. Call it at the head of every callback.
  bool jumped();

  /// The same with the clocks as arguments.
  bool jumped(ros::Time now, ros::SteadyTime steady, bool simulated);

 private:
  ros::Time last_;
  ros::SteadyTime last_steady_;
};

}  // namespace tunnel_pilot::shell
