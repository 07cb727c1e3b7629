#include "bag_reading.h"

#include <rosbag/view.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <filesystem>
#include <iostream>
#include <stdexcept>

#include "tunnel_pilot/simulation/perception_chain.h"

namespace tunnel_pilot::tools {
namespace {

constexpr rlim_t kMemoryLimit = rlim_t{4} << 30;  // [bytes]

int run(const std::string& who, const std::function<int()>& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    std::cerr << who << ": " << error.what() << "\n";
    return kBadInput;
  }
}

}  // namespace

std::string defaultConfig() {
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe");
  for (std::filesystem::path folder = program.parent_path(); folder.has_relative_path();
       folder = folder.parent_path()) {
    for (const std::filesystem::path& config :
         {folder / "config", folder / "share/tunnel_pilot/config"}) {
      if (std::filesystem::exists(config / "centerline.yaml")) return config.string();
    }
  }
  throw std::runtime_error("no parameter files found beside the program: name them with --config");
}

std::vector<std::string> perceptionFilesFrom(const std::string& folder) {
  std::vector<std::string> files = simulation::perceptionFiles(defaultConfig());
  if (folder.empty()) return files;
  const std::vector<std::string> given = simulation::perceptionFiles(folder);
  bool any = false;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (!std::filesystem::exists(given[i])) continue;
    files[i] = given[i];
    any = true;
  }
  if (!any) throw std::runtime_error("'" + folder + "' holds none of the perception's parameter files");
  return files;
}

std::vector<std::string> topicsOfType(const rosbag::Bag& bag, const std::string& type) {
  rosbag::View view(bag);
  std::vector<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (connection->datatype == type) topics.push_back(connection->topic);
  }
  std::sort(topics.begin(), topics.end());
  topics.erase(std::unique(topics.begin(), topics.end()), topics.end());
  return topics;
}

bool sameTopic(const std::string& a, const std::string& b) {
  const auto bare = [](const std::string& topic) {
    return topic.substr(topic.rfind('/', 0) == 0 ? 1 : 0);
  };
  return bare(a) == bare(b);
}

std::string scanTopic(const rosbag::Bag& bag, const std::string& wanted) {
  const std::vector<std::string> topics = topicsOfType(bag, "sensor_msgs/LaserScan");
  std::string list;
  for (const std::string& topic : topics) list += " " + topic;
  if (topics.empty()) throw std::runtime_error("the bag holds no sensor_msgs/LaserScan");
  if (wanted.empty() && topics.size() == 1) return topics.front();
  for (const std::string& topic : topics) {
    if (sameTopic(topic, wanted.empty() ? "scan" : wanted)) return topic;
  }
  if (!wanted.empty()) {
    throw std::runtime_error("the bag has no scans on '" + wanted + "', but on" + list);
  }
  throw std::runtime_error("the bag has several scan topics, choose one with --topic:" + list);
}

Stamp stampOf(const std_msgs::Header& header) {
  return std::chrono::seconds(header.stamp.sec) + std::chrono::nanoseconds(header.stamp.nsec);
}

geometry::Scan scanOf(const sensor_msgs::LaserScan& message) {
  geometry::Scan scan;
  scan.stamp = stampOf(message.header);
  scan.angle_min = message.angle_min;
  scan.angle_increment = message.angle_increment;
  scan.announced_angle_max = message.angle_max;
  scan.time_increment = message.time_increment;
  scan.range_min = message.range_min;
  scan.range_max = message.range_max;
  scan.ranges = message.ranges;
  return scan;
}

drivers::Motion motionOf(const nav_msgs::Odometry& message) {
  const auto& q = message.pose.pose.orientation;
  drivers::Motion motion;
  motion.stamp = stampOf(message.header);
  motion.pose = {message.pose.pose.position.x, message.pose.pose.position.y,
                 std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))};
  motion.speed = message.twist.twist.linear.x;
  motion.yaw_rate = message.twist.twist.angular.z;
  return motion;
}

void limitMemory() {
  const rlimit limit{kMemoryLimit, kMemoryLimit};
  setrlimit(RLIMIT_AS, &limit);
}

int runGuarded(const std::string& who, const std::function<int()>& work) {
  const pid_t child = fork();
  if (child == 0) _exit(run(who, work));
  int state = 0;
  if (child < 0 || waitpid(child, &state, 0) != child)
    throw std::runtime_error("cannot start a process");
  if (WIFEXITED(state)) return WEXITSTATUS(state);
  std::cerr << who << ": the bag is damaged: reading it ended with '" << strsignal(WTERMSIG(state))
            << "'\n";
  return kBadInput;
}

}  // namespace tunnel_pilot::tools
