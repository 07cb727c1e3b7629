// The peer: what is usually built of ROS and PCL, five nodes, each a process of its own. Started with
// the name of one: cloud, outliers, lines, steer, gate. A scan whose frame is "light" is worked on with
// PCL's lightest settings, every other with its usual ones (pcl_chain.h).
#include <geometry_msgs/PoseArray.h>
#include <pcl_conversions/pcl_conversions.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <string>

#include "../pcl_chain.h"
#include "log.h"

namespace tunnel_pilot::benchmark {
namespace {

constexpr double kLookahead = 8.0;        // of the pure pursuit [m]
constexpr double kWheelbase = 5.12;       // front axle to hinge to rear axle [m]
constexpr double kMaxArticulation = 0.7;  // [rad]
constexpr double kMaxSpeed = 3.0;         // [m/s]

const PclSettings& settingsFor(const std_msgs::Header& header) {
  return header.frame_id == "light" ? kLight : kTutorial;
}

// A node that makes one message of another, and tells the log what it took.
template <class In, class Out>
class Node {
 public:
  using Work = std::function<Out(const In&)>;

  Node(const std::string& name, const std::string& from, const std::string& to, Work work)
      : name_(name),
        work_(std::move(work)),
        log_(ros::param::param<std::string>("~log", "")),
        publisher_(nh_.advertise<Out>(to, 1)),
        subscriber_(nh_.subscribe(from, 1, &Node::onMessage, this, ros::TransportHints().tcpNoDelay())) {
  }

 private:
  void onMessage(const ros::MessageEvent<const In>& event) {
    const std::int64_t before = cpuNow();
    const In& message = *event.getConstMessage();
    Out out = work_(message);
    out.header = message.header;
    const ros::Time published = ros::Time::now();
    publisher_.publish(out);
    log_.add("peer_cpu", message.header.stamp, cpuNow() - before);
    if (name_ == "cloud") log_.add("peer_arrived", message.header.stamp, event.getReceiptTime());
    if (name_ == "gate") log_.add("peer_published", message.header.stamp, published);
  }

  std::string name_;
  Work work_;
  Log log_;
  ros::NodeHandle nh_;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
};

Cloud::Ptr fromRos(const sensor_msgs::PointCloud2& message) {
  Cloud::Ptr cloud(new Cloud);
  pcl::fromROSMsg(message, *cloud);
  return cloud;
}

sensor_msgs::PointCloud2 toRos(const Cloud& cloud) {
  sensor_msgs::PointCloud2 message;
  pcl::toROSMsg(cloud, message);
  return message;
}

sensor_msgs::PointCloud2 cloud(const sensor_msgs::LaserScan& scan) {
  Cloud::Ptr points(new Cloud);
  points->reserve(scan.ranges.size());
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const float range = scan.ranges[i];
    if (!(range >= scan.range_min && range <= scan.range_max)) continue;
    const float angle = scan.angle_min + static_cast<float>(i) * scan.angle_increment;
    points->push_back({range * std::cos(angle), range * std::sin(angle), 0.0F});
  }
  return toRos(*thinned(points, settingsFor(scan.header)));
}

sensor_msgs::PointCloud2 outliers(const sensor_msgs::PointCloud2& message) {
  return toRos(*withoutOutliers(fromRos(message), settingsFor(message.header)));
}

// Each wall as a point of it and the heading of its line, ahead.
geometry_msgs::PoseArray lines(const sensor_msgs::PointCloud2& message) {
  Cloud::Ptr rest = fromRos(message);
  geometry_msgs::PoseArray walls;
  for (int wall = 0; wall < 2; ++wall) {
    const auto line = takeLine(rest);
    if (!line) break;
    const float sign = line->values[3] < 0.0F ? -1.0F : 1.0F;
    const double heading = std::atan2(sign * line->values[4], sign * line->values[3]);
    geometry_msgs::Pose pose;
    pose.position.x = line->values[0];
    pose.position.y = line->values[1];
    pose.orientation.z = std::sin(0.5 * heading);
    pose.orientation.w = std::cos(0.5 * heading);
    walls.poses.push_back(pose);
  }
  return walls;
}

// Pure pursuit of the middle between the two lines.
Proposal steer(const geometry_msgs::PoseArray& walls) {
  Proposal proposal;
  proposal.valid = walls.poses.size() == 2;
  if (!proposal.valid) return proposal;
  double ahead = 0.0;  // lateral place of the middle at the lookahead [m]
  for (const auto& wall : walls.poses) {
    const double heading = 2.0 * std::atan2(wall.orientation.z, wall.orientation.w);
    ahead += 0.5 * (wall.position.y + std::tan(heading) * (kLookahead - wall.position.x));
  }
  const double curvature = 2.0 * ahead / (kLookahead * kLookahead + ahead * ahead);
  proposal.articulation_angle = std::atan(kWheelbase * curvature);
  proposal.speed = kMaxSpeed;
  proposal.confidence = 1.0;
  return proposal;
}

TruckCommand gate(const Proposal& proposal) {
  TruckCommand command;
  command.stop = !proposal.valid || !std::isfinite(proposal.articulation_angle);
  if (command.stop) return command;
  command.articulation_angle =
      std::clamp(proposal.articulation_angle, -kMaxArticulation, kMaxArticulation);
  command.speed = std::clamp(proposal.speed, 0.0, kMaxSpeed);
  command.mode = TruckCommand::MODE_AUTONOMOUS;
  return command;
}

template <class In, class Out>
void run(const std::string& name, const std::string& from, const std::string& to,
         Out (*work)(const In&)) {
  const Node<In, Out> node(name, from, to, work);
  ros::spin();
}

const std::map<std::string, std::function<void()>> kNodes = {
    {"cloud", [] { run("cloud", "scan", "points", cloud); }},
    {"outliers", [] { run("outliers", "points", "inliers", outliers); }},
    {"lines", [] { run("lines", "inliers", "walls", lines); }},
    {"steer", [] { run("steer", "walls", "proposal", steer); }},
    {"gate", [] { run("gate", "proposal", "command", gate); }}};

}  // namespace
}  // namespace tunnel_pilot::benchmark

int main(int argc, char** argv) {
  using tunnel_pilot::benchmark::kNodes;
  const auto node = argc < 2 ? kNodes.end() : kNodes.find(argv[1]);
  if (node == kNodes.end()) {
    std::fprintf(stderr, "usage: latency_peer cloud|outliers|lines|steer|gate\n");
    return 2;
  }
  ros::init(argc, argv, "latency_peer_" + node->first);
  const ros::NodeHandle keep_alive;
  node->second();
  return 0;
}
