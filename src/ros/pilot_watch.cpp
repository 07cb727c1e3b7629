#include "tunnel_pilot/ros/pilot_watch.h"

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/Heartbeat.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>

#include <algorithm>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/pilot_nodes.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kLeastWatch = 2.0;    // [s] steady time
constexpr double kLongestWatch = 5.0;  // [s] steady time
constexpr double kPoll = 0.001;        // [s] steady time
constexpr std::uint32_t kQueue = 1000;

template <class Message>
std::string frameOf(const Message&) {
  return "";
}
std::string frameOf(const sensor_msgs::LaserScan& scan) { return scan.header.frame_id; }

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

PilotWatch::PilotWatch(ros::NodeHandle nh) : nh_(nh) {
  count<sensor_msgs::LaserScan>("scan");
  count<sensor_msgs::JointState>("joint_states");
  count<nav_msgs::Odometry>("odom");
  count<TruckCommand>("command");
  const boost::function<void(const tunnel_pilot::Heartbeat&)> beat = [this](const auto& m) {
    alive_.insert(m.node);
  };
  const boost::function<void(const Proposal&)> proposal = [this](const auto& m) {
    facts_.model = m.model;
  };
  const boost::function<void(const TruckStatus&)> truck = [this](const auto& m) { facts_.truck = m; };
  const boost::function<void(const ArbiterState&)> arbiter = [this](const auto& m) {
    facts_.arbiter = m;
  };
  subscribers_.push_back(nh_.subscribe<tunnel_pilot::Heartbeat>("heartbeat", kQueue, beat));
  subscribers_.push_back(nh_.subscribe<Proposal>("lidar_driver/proposal", 1, proposal));
  subscribers_.push_back(nh_.subscribe<TruckStatus>("truck_status", 1, truck));
  subscribers_.push_back(nh_.subscribe<ArbiterState>("arbiter_state", 1, arbiter));
}

template <class Message>
void PilotWatch::count(const std::string& topic) {
  const boost::function<void(const Message&)> arrived = [this, topic](const Message& message) {
    const ros::Time time = ros::Time::now();
    Arrivals& arrivals = arrivals_[topic];
    if (!arrivals.first) arrivals.first = time;
    arrivals.last = time;
    ++arrivals.count;
    // The core's stamps: ros::Time throws where two are more than 68 years apart.
    arrivals.ages.push_back(toSeconds(toCore(time) - toCore(message.header.stamp)));
    if (const std::string frame = frameOf(message); !frame.empty()) facts_.lidar_frame = frame;
  };
  subscribers_.push_back(nh_.subscribe<Message>(topic, kQueue, arrived, ros::VoidConstPtr(),
                                                ros::TransportHints().tcpNoDelay()));
}

// Simulated time may begin only when the first tick of the clock has come.
void PilotWatch::watch() {
  const ros::SteadyTime begin = ros::SteadyTime::now();
  std::optional<ros::Time> first;
  bool mounted = false;
  while (ros::ok()) {
    ros::spinOnce();
    ros::WallDuration(kPoll).sleep();
    const ros::Time now = ros::Time::now();
    if (!first && !now.isZero()) first = now;
    facts_.clock_passed = first ? (now - *first).toSec() : 0.0;
    const double watched = (ros::SteadyTime::now() - begin).toSec();
    const bool frame_known = arrivals_["scan"].count > 0 || watched > kLeastWatch;
    if (!mounted && frame_known) mounted = sensor_pose_.find(facts_.lidar_frame).has_value();
    const bool enough = facts_.clock_passed >= 1.0 && mounted;
    if (watched > kLongestWatch || (watched > kLeastWatch && enough)) break;
  }
  if (!mounted) facts_.mounting_problem = sensor_pose_.whyNot();
}

std::map<std::string, std::vector<std::string>> PilotWatch::publishers() const {
  std::map<std::string, std::vector<std::string>> by_topic;
  XmlRpc::XmlRpcValue call, answer, state;
  call[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", call, answer, state, false)) return by_topic;
  for (int i = 0; i < state[0].size(); ++i) {
    auto& names = by_topic[static_cast<std::string>(state[0][i][0])];
    for (int n = 0; n < state[0][i][1].size(); ++n) {
      names.push_back(static_cast<std::string>(state[0][i][1][n]));
    }
  }
  return by_topic;
}

TopicFacts PilotWatch::topicFacts(const Arrivals& arrivals) const {
  TopicFacts facts;
  facts.messages = arrivals.count;
  if (arrivals.count < 2) return facts;
  const double passed = (*arrivals.last - *arrivals.first).toSec();
  if (passed > 0.0) facts.rate = static_cast<double>(arrivals.count - 1) / passed;
  facts.age = median(arrivals.ages);
  return facts;
}

CheckFacts PilotWatch::facts() {
  CheckFacts facts = facts_;
  facts.sim_time = ros::Time::isSimTime();
  for (const char* node : kPilotNodes) {
    facts.nodes[node] = {nh_.hasParam(node), alive_.count(nh_.resolveName(node)) > 0};
  }
  const auto by_topic = publishers();
  for (const char* topic : {"scan", "joint_states", "odom", "command"}) {
    facts.topics[topic] = topicFacts(arrivals_[topic]);
    const auto found = by_topic.find(nh_.resolveName(topic));
    if (found != by_topic.end()) facts.topics[topic].publishers = found->second;
  }
  return facts;
}

}  // namespace tunnel_pilot::shell
