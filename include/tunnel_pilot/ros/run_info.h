#pragma once

#include <ros/node_handle.h>
#include <ros/time.h>
#include <tunnel_pilot/Proposal.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <map>
#include <set>
#include <string>

namespace tunnel_pilot::shell {

/// What a recording has to tell of itself.
struct RunFacts {
  ros::Time time;                                         ///< ROS time when this was told
  double system_time = 0.0;                               ///< since 1970 [s]; another one in simulation
  std::map<std::string, XmlRpc::XmlRpcValue> parameters;  ///< by node
  std::set<std::string> models;  ///< networks that proposed: name and SHA-256, as proposals tell
};

/// The facts as YAML: `package`, `version`, `time` [s], `system_time` [s], `networks` (name and SHA-256
/// of each), `parameters` (of each node), `files` (SHA-256 of each file that a parameter names by its
/// absolute path, where it can be read). Throws config::ConfigError for parameters that YAML does not
/// know.
std::string runInfoText(const RunFacts& facts);

/// Tells on `run_info` (std_msgs/String, latched, runInfoText) with what parameters and networks the
/// pilot drives, so that a bag explains itself. Tells once: as soon as the parameters are there and, if
/// lidar_driver is among the nodes, its network proposed, but after 5 s of steady time what there is;
/// and again whenever another network proposes. Subscribes `lidar_driver/proposal` and
/// `preview_driver/proposal`; reads the parameters of kPilotNodes and of the simulator. No parameters of
/// its own. Throws config::ConfigError for any that is given.
class RunInfo {
 public:
  RunInfo(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void onProposal(const Proposal& message);
  void onTimer();
  bool isComplete() const;
  void tell();

  ros::NodeHandle nh_;
  ros::Publisher publisher_;
  ros::Subscriber lidar_subscriber_, preview_subscriber_;
  ros::WallTimer timer_;
  ros::SteadyTime started_ = ros::SteadyTime::now();
  std::set<std::string> models_;
  bool told_ = false;
};

}  // namespace tunnel_pilot::shell
