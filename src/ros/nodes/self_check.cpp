// Looks at a running pilot for some seconds and tells, one line each, what is right, what is not, and
// what to do. Exit status 0: all is right, 1: something is not.
#include <ros/ros.h>

#include <cstdio>
#include <string>

#include "tunnel_pilot/ros/pilot_watch.h"

namespace tunnel_pilot::shell::node {

int self_check(int argc, char** argv) {
  ros::init(argc, argv, "self_check", ros::init_options::AnonymousName);
  const auto tell = [](const Finding& finding) { std::printf("%s\n", finding.line().c_str()); };
  const std::string master = "master: " + ros::master::getURI();
  if (!ros::master::check()) {
    tell(
        {false, master + " cannot be reached", "start a launch file or roscore, or set ROS_MASTER_URI"});
    return 1;
  }
  tell({true, master, ""});
  PilotWatch watch{ros::NodeHandle()};
  watch.watch();
  const auto findings = judge(watch.facts());
  for (const Finding& finding : findings) tell(finding);
  return allOk(findings) ? 0 : 1;
}

}  // namespace tunnel_pilot::shell::node
