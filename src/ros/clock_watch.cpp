#include "tunnel_pilot/ros/clock_watch.h"

#include <cmath>

namespace tunnel_pilot::shell {

bool ClockWatch::jumped() {
  return jumped(ros::Time::now(), ros::SteadyTime::now(), ros::Time::isSimTime());
}

bool ClockWatch::jumped(ros::Time now, ros::SteadyTime steady, bool simulated) {
  const bool begun = !last_.isZero();
  const double progress = (now - last_).toSec();
  const double steady_progress = (steady - last_steady_).toSec();
  last_ = now;
  last_steady_ = steady;
  if (!begun) return false;
  if (simulated) return progress < 0.0 || progress > kLargestStep;
  return std::abs(progress - steady_progress) > kLargestDrift;
}

}  // namespace tunnel_pilot::shell
