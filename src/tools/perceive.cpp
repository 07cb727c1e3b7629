// perceive: runs the perception core over a recorded bag; one CSV row a scan.
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/LaserScan.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "bag_reading.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/simulation/perception_chain.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr const char* kOdometryTopic = "odom";

struct Arguments {
  std::string bag;
  std::string csv;
  std::string topic;
  std::string config;
  std::vector<double> transform = {0.0, 0.0, 0.0};
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "perceive --bag FILE --csv FILE: runs the perception over a recorded bag.\n"
      "Writes stamp,valid,width,heading_error,lateral_offset,curvature [s, 1, m, rad, m, 1/m] for each\n"
      "scan; the numbers are empty where valid is 0.\nOptions");
  shown.add_options()("help,h", "this text")(
      "bag", options::value(&arguments.bag)->required()->value_name("FILE"), "recorded bag")(
      "csv", options::value(&arguments.csv)->required()->value_name("FILE"), "output")(
      "topic", options::value(&arguments.topic)->value_name("NAME"),
      "scan topic; needed only where the bag has several and none is /scan")(
      "config", options::value(&arguments.config)->value_name("DIR"),
      "scan_filter.yaml, wall_segmentation.yaml or centerline.yaml found here replace the package's "
      "own, "
      "for instance config/corridor for widths of 1.3 to 4.2 m")(
      "transform", options::value(&arguments.transform)->multitoken()->value_name("X Y YAW"),
      "laser in base_link [m m rad]; without it the laser's frame is taken as base_link");
  using Style = options::command_line_style::style_t;
  options::variables_map values;
  // Without short options, so that "-0.5" is a number.
  options::store(options::command_line_parser(argc, argv)
                     .options(shown)
                     .style(Style::unix_style & ~Style::allow_short)
                     .run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 done, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  const auto& transform = arguments.transform;
  if (transform.size() != 3 || !std::isfinite(transform[0] + transform[1] + transform[2])) {
    throw options::error("--transform needs three numbers: x y yaw");
  }
  return true;
}

std::string row(Stamp stamp, const perception::Tunnel* tunnel) {
  char text[256];
  const auto ns = static_cast<long long>(stamp.count());
  int length = std::snprintf(text, sizeof text, "%lld.%09lld,", ns / 1'000'000'000, ns % 1'000'000'000);
  std::string line(text, static_cast<std::size_t>(length));
  if (tunnel == nullptr || !tunnel->state.valid) return line + "0,,,,\n";
  const perception::TunnelState& state = tunnel->state;
  length = std::snprintf(text, sizeof text, "1,%.6f,%.6f,%.6f,%.6f\n", state.width, state.heading_error,
                         state.lateral_offset, state.curvature);
  return line + std::string(text, static_cast<std::size_t>(length));
}

// Takes a bag's messages in their order, as the nodelets would.
class Perceiver {
 public:
  Perceiver(const simulation::PerceptionParameters& parameters, const geometry::Pose& sensor)
      : chain_(parameters), sensor_(sensor) {}

  void takeOdometry(const nav_msgs::Odometry& message) {
    const drivers::Motion motion = tools::motionOf(message);
    odometry_.add(motion, motion.stamp);  // the recorder's clock may be another
  }

  void takeScan(const sensor_msgs::LaserScan& message) {
    const geometry::Scan scan = tools::scanOf(message);
    const perception::Tunnel* tunnel =
        chain_.update(scan, sensor_, odometry_.poseAt(scan.stamp), scan.stamp);
    csv_ += row(scan.stamp, tunnel);
    if (tunnel == nullptr) {
      ++answers_[perception::toString(chain_.filtered().rejection)];
    } else {
      ++answers_[tunnel->state.valid ? "valid" : perception::toString(tunnel->state.reason)];
    }
  }

  const std::string& csv() const { return csv_; }
  const std::map<std::string, int>& answers() const { return answers_; }

 private:
  simulation::PerceptionChain chain_;
  geometry::Pose sensor_;
  drivers::MotionHistory odometry_;
  std::string csv_ = "stamp,valid,width,heading_error,lateral_offset,curvature\n";
  std::map<std::string, int> answers_;
};

void readBag(const Arguments& arguments, Perceiver& perceiver) {
  rosbag::Bag bag(arguments.bag, rosbag::bagmode::Read);
  const std::string topic = tools::scanTopic(bag, arguments.topic);
  rosbag::View view(bag, [&](const rosbag::ConnectionInfo* connection) {
    return connection->topic == topic || tools::sameTopic(connection->topic, kOdometryTopic);
  });
  for (const rosbag::MessageInstance& message : view) {
    if (message.getTopic() == topic) {
      const auto scan = message.instantiate<sensor_msgs::LaserScan>();
      if (!scan) throw std::runtime_error("a message on '" + topic + "' is not a scan");
      perceiver.takeScan(*scan);
    } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
      perceiver.takeOdometry(*odometry);
    }
  }
}

void perceive(const Arguments& arguments) {
  if (!std::filesystem::is_regular_file(arguments.bag)) throw std::runtime_error("no such file");
  std::error_code other;
  if (std::filesystem::equivalent(arguments.bag, arguments.csv, other)) {
    throw std::runtime_error("the bag itself is named as --csv");
  }
  simulation::PerceptionParameters parameters =
      simulation::loadPerception(tools::perceptionFilesFrom(arguments.config));
  parameters.scan_filter.check_age = false;  // a recording is as old as it is
  Perceiver perceiver(parameters,
                      {arguments.transform[0], arguments.transform[1], arguments.transform[2]});
  readBag(arguments, perceiver);
  std::ofstream out(arguments.csv, std::ios::binary | std::ios::trunc);
  out << perceiver.csv();
  out.close();
  if (!out) throw std::runtime_error("cannot write '" + arguments.csv + "'");
  for (const auto& [answer, count] : perceiver.answers()) {
    std::cerr << "perceive: " << count << " scans: " << answer << "\n";
  }
  if (perceiver.answers().count("valid") == 0 && arguments.config.empty()) {
    std::cerr << "perceive: no tunnel seen; corridors of 1.3 to 4.2 m need --config config/corridor\n";
  }
}

}  // namespace

int main(int argc, char** argv) {
  tools::limitMemory();
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return tools::kDone;
    return tools::runGuarded("perceive: " + arguments.bag, [&] {
      perceive(arguments);
      return tools::kDone;
    });
  } catch (const std::exception& error) {
    std::cerr << "perceive: " << error.what() << "\n";
    return tools::kBadInput;
  }
}
