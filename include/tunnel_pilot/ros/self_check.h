#pragma once

#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/TruckStatus.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tunnel_pilot::shell {

/// What was seen of a node of the pilot.
struct NodeFacts {
  bool has_parameters = false;
  bool gives_signs_of_life = false;  ///< its heartbeat came: it is up and has read its parameters
};

/// What was seen of a topic while it was watched.
struct TopicFacts {
  std::vector<std::string> publishers;
  std::size_t messages = 0;
  double rate = 0.0;  ///< messages a second of ROS time
  double age = 0.0;   ///< median of ROS time less the stamp, when they came [s]
};

/// All that the check looks at.
struct CheckFacts {
  bool sim_time = false;
  double clock_passed = 0.0;                 ///< ROS time that passed while it was watched [s]
  std::map<std::string, NodeFacts> nodes;    ///< of kPilotNodes
  std::string lidar_frame = "laser";         ///< of the scans
  std::string mounting_problem;              ///< why its place on base_link is not known; empty: it is
  std::map<std::string, TopicFacts> topics;  ///< scan, joint_states, odom, command
  std::string model;                         ///< of the network that proposes: name and SHA-256
  std::optional<TruckStatus> truck;
  std::optional<ArbiterState> arbiter;
};

/// One line of the check.
struct Finding {
  bool ok = false;
  std::string what;
  std::string advice;  ///< what to do; empty where nothing is to be done

  std::string line()
      const;  ///< "OK    scan: 35.0 Hz", "FAIL  scan: nobody publishes it; start the lidar"
};

/// Judges a pilot that was watched: clock, nodes, the lidar's place, topics with their rates and stamps,
/// network, state of the truck. Rates and ages are held against what the pilot needs
/// (docs/supervision.md): 10 messages a second, stamps within 0.1 s ahead and 0.5 s behind.
std::vector<Finding> judge(const CheckFacts& facts);

bool allOk(const std::vector<Finding>& findings);

}  // namespace tunnel_pilot::shell
