// extract: makes a data set for training of recorded drives.
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bag_reading.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/learning/data_file.h"
#include "tunnel_pilot/learning/demonstration.h"
#include "tunnel_pilot/simulation/perception_chain.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;

constexpr const char* kJoint = "articulation_joint";
constexpr double kClockJump = 1.0;    // of a stamp ahead of the time of its recording [s]
constexpr double kStepBack = 0.1;     // of a stamp behind the one before [s]
constexpr double kClockDrift = 10.0;  // of stamps against the times of their recording, over a bag [s]

struct Arguments {
  std::vector<std::string> bags;
  std::string out;
  std::string topic;
  std::string config;
  std::vector<double> transform;
  double delay = 0.0;  // 0: what lidar_driver.yaml says
  double scan_delay = 0.04;
  double tunnel_length = 0.0;  // 0: each bag is one tunnel
  bool correct = false;
  bool strict = false;
};

void check(const Arguments& arguments) {
  const auto within = [](const char* name, double value, double min, double max) {
    if (!(value >= min && value <= max)) {
      throw options::error(std::string(name) + " must be " + std::to_string(min) + " to " +
                           std::to_string(max));
    }
  };
  if (arguments.delay != 0.0) within("--delay [s]", arguments.delay, 0.05, 2.0);
  within("--scan-delay [s]", arguments.scan_delay, 0.0, 0.5);
  if (arguments.tunnel_length != 0.0) within("--tunnel-length [m]", arguments.tunnel_length, 10.0, 1e6);
  const auto& transform = arguments.transform;
  if (!transform.empty() &&
      (transform.size() != 3 || !std::isfinite(transform[0] + transform[1] + transform[2]))) {
    throw options::error("--transform needs three numbers: x y yaw");
  }
  for (const std::string& bag : arguments.bags) {
    std::error_code other;
    if (std::filesystem::equivalent(bag, arguments.out, other)) {
      throw options::error("the bag '" + bag + "' itself is named as --out");
    }
  }
}

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "extract --out DRIVES.tpds BAG...: makes a data set for `train --data` of recorded drives.\n"
      "A bag must hold a sensor_msgs/LaserScan, joint_states with articulation_joint, and odom. Each "
      "scan\n"
      "is labelled with the articulation that the driver had after the truck's delays. What was driven "
      "at\n"
      "less than 0.5 m/s or in reverse is left out.\nOptions");
  shown.add_options()("help,h", "this text")(
      "bag", options::value(&arguments.bags)->required()->value_name("FILE"),
      "recorded bags; also without the option's name")(
      "out", options::value(&arguments.out)->required()->value_name("FILE"), "data set to write")(
      "topic", options::value(&arguments.topic)->value_name("NAME"),
      "scan topic; needed only where a bag has several and none is /scan; scan_filtered will do")(
      "config", options::value(&arguments.config)->value_name("DIR"),
      "truck.yaml, lidar_driver.yaml and the perception's files found here replace the package's own")(
      "transform", options::value(&arguments.transform)->multitoken()->value_name("X Y YAW"),
      "laser in base_link [m m rad] instead of where truck.yaml has it; put other options behind it")(
      "delay", options::value(&arguments.delay)->value_name("S"),
      "from a demand to the articulation that shows it [s]; without it transport delay, dead time and "
      "lag of lidar_driver.yaml")("scan-delay", options::value(&arguments.scan_delay)->value_name("S"),
                                  "from a scan's stamp until a driver gets it [s] (0.04)")(
      "tunnel-length", options::value(&arguments.tunnel_length)->value_name("M"),
      "after so much driving [m] a new tunnel begins, so that parts of one bag can be held out; without "
      "it each bag is one tunnel")(
      "correct", options::bool_switch(&arguments.correct),
      "labels that lead to the middle of the tunnel instead of where the driver drove")(
      "strict", options::bool_switch(&arguments.strict),
      "ends at the first bag that cannot be used; without it that bag is left out");
  options::positional_options_description positional;
  positional.add("bag", -1);
  using Style = options::command_line_style::style_t;
  options::variables_map values;
  // Without short options, so that "-0.5" is a number.
  options::store(options::command_line_parser(argc, argv)
                     .options(shown)
                     .positional(positional)
                     .style(Style::unix_style & ~Style::allow_short)
                     .run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 done, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  check(arguments);
  return true;
}

// A file of the given folder, or the package's own.
std::string fileOf(const std::string& folder, const std::string& name) {
  const std::filesystem::path given = std::filesystem::path(folder) / name;
  if (!folder.empty() && std::filesystem::exists(given)) return given.string();
  return (std::filesystem::path(tools::defaultConfig()) / name).string();
}

struct Setup {
  vehicle::TruckGeometry truck;
  simulation::PerceptionParameters perception;
  learning::DemonstrationParameters demonstration;
  geometry::Pose sensor;
};

std::vector<std::string> perceptionFiles(const std::string& folder) {
  for (const std::string& file : simulation::perceptionFiles(folder)) {
    if (!folder.empty() && std::filesystem::exists(file)) return tools::perceptionFilesFrom(folder);
  }
  return tools::perceptionFilesFrom("");
}

Setup loadSetup(const Arguments& arguments) {
  if (!arguments.config.empty() && !std::filesystem::is_directory(arguments.config)) {
    throw std::runtime_error("--config '" + arguments.config + "' is no folder");
  }
  const std::string driver_file = fileOf(arguments.config, "lidar_driver.yaml");
  const drivers::LidarDriverParameters driver =
      drivers::loadLidarDriver(config::loadFile(driver_file), "");
  Setup setup{vehicle::loadTruck(fileOf(arguments.config, "truck.yaml")).geometry,
              simulation::loadPerception(perceptionFiles(arguments.config)),
              learning::demonstrationParameters(driver.steering, arguments.scan_delay),
              {}};
  setup.perception.scan_filter.check_age = false;  // a recording is as old as it is
  setup.sensor = {setup.truck.lidar_x, setup.truck.lidar_y, 0.0};
  if (arguments.delay > 0.0) {
    setup.demonstration.label_after = arguments.scan_delay + arguments.delay;
  }
  if (!arguments.transform.empty()) {
    setup.sensor = {arguments.transform[0], arguments.transform[1], arguments.transform[2]};
  }
  return setup;
}

// Calls the handlers with the messages of a drive, in the order of their recording.
template <typename Scan, typename Joints, typename Odometry>
void readDrive(const rosbag::Bag& bag, const std::string& scan_topic, Scan takeScan, Joints takeJoints,
               Odometry takeOdometry) {
  rosbag::View view(bag, [&](const rosbag::ConnectionInfo* connection) {
    return connection->topic == scan_topic || tools::sameTopic(connection->topic, "joint_states") ||
           tools::sameTopic(connection->topic, "odom");
  });
  for (const rosbag::MessageInstance& message : view) {
    if (message.getTopic() == scan_topic) {
      const auto scan = message.instantiate<sensor_msgs::LaserScan>();
      if (!scan) throw std::runtime_error("a message on '" + scan_topic + "' is not a scan");
      takeScan(*scan, message.getTime());
    } else if (const auto joints = message.instantiate<sensor_msgs::JointState>()) {
      takeJoints(*joints, message.getTime());
    } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
      takeOdometry(*odometry, message.getTime());
    }
  }
}

// Index of the articulation in a message; none without it.
std::optional<std::size_t> articulationIn(const sensor_msgs::JointState& joints) {
  const auto at = std::find(joints.name.begin(), joints.name.end(), kJoint);
  const auto index = static_cast<std::size_t>(at - joints.name.begin());
  if (at == joints.name.end() || index >= joints.position.size()) return std::nullopt;
  return index;
}

// Tells clocks that jump: stamps go on as the times of their recording do. A recorder that was held up,
// in a fast simulation by a second and more of its time, takes messages late and then many at once:
// stamps may go on more slowly than that for a while, but neither back nor much faster.
class ClockCheck {
 public:
  void take(const std_msgs::Header& header, const ros::Time& recorded, const char* topic) {
    const Stamp stamp = tools::stampOf(header);
    const Stamp time = std::chrono::seconds(recorded.sec) + std::chrono::nanoseconds(recorded.nsec);
    const auto [found, is_new] = clocks_.emplace(topic, Clock{stamp, time, time - stamp});
    if (is_new) return;
    Clock& clock = found->second;
    const double advance = toSeconds(stamp - clock.stamp);
    const double passed = toSeconds(time - clock.time);
    if (advance < -kStepBack || advance - passed > kClockJump) refuse(topic, "jumps", advance - passed);
    const double drift = toSeconds(clock.first_distance - (time - stamp));
    if (std::abs(drift) > kClockDrift) refuse(topic, "drifts", drift);
    clock.stamp = stamp;
    clock.time = time;
  }

 private:
  struct Clock {
    Stamp stamp, time;     // of the last message
    Stamp first_distance;  // of the first one's recording behind its stamp
  };

  [[noreturn]] static void refuse(const std::string& topic, const std::string& what, double seconds) {
    throw std::runtime_error("the clock of '" + topic + "' " + what + " by " + std::to_string(seconds) +
                             " s, or the recorder lost messages");
  }

  std::map<std::string, Clock> clocks_;
};

bool sameGeometry(const sensor_msgs::LaserScan& a, const sensor_msgs::LaserScan& b) {
  return a.angle_min == b.angle_min && a.angle_increment == b.angle_increment &&
         a.ranges.size() == b.ranges.size() && a.range_max == b.range_max;
}

// Reads a bag through and throws std::runtime_error when no drive can be extracted from it.
void checkBag(const std::string& file, const Arguments& arguments) {
  if (!std::filesystem::is_regular_file(file)) throw std::runtime_error("no such file");
  rosbag::Bag bag(file, rosbag::bagmode::Read);
  ClockCheck clock;
  std::optional<sensor_msgs::LaserScan> first;
  std::size_t articulations = 0;
  std::size_t odometries = 0;
  readDrive(
      bag, tools::scanTopic(bag, arguments.topic),
      [&](const sensor_msgs::LaserScan& scan, const ros::Time& time) {
        clock.take(scan.header, time, "scan");
        if (!first) first = scan;
        if (!sameGeometry(*first, scan))
          throw std::runtime_error("it mixes scans of several geometries");
      },
      [&](const sensor_msgs::JointState& joints, const ros::Time& time) {
        if (!articulationIn(joints)) return;
        clock.take(joints.header, time, "joint_states");
        ++articulations;
      },
      [&](const nav_msgs::Odometry& odometry, const ros::Time& time) {
        clock.take(odometry.header, time, "odom");
        ++odometries;
      });
  if (!first) throw std::runtime_error("it holds no scan");
  if (articulations == 0) throw std::runtime_error("it holds no joint_states with articulation_joint");
  if (odometries == 0) throw std::runtime_error("it holds no odom");
}

// Puts articulations and odometry together: a motion for each articulation, with the odometry of its
// time.
class MotionJoiner {
 public:
  void take(const sensor_msgs::JointState& joints) {
    const std::optional<std::size_t> index = articulationIn(joints);
    if (!index) return;
    drivers::Motion motion;
    motion.stamp = tools::stampOf(joints.header);
    motion.articulation = joints.position[*index];
    if (*index < joints.velocity.size() && std::isfinite(joints.velocity[*index])) {
      motion.articulation_rate = joints.velocity[*index];
    } else if (last_ && motion.stamp > last_->stamp) {
      motion.articulation_rate =
          (motion.articulation - last_->articulation) / toSeconds(motion.stamp - last_->stamp);
    }
    last_ = motion;
    waiting_.push_back(motion);
  }

  void take(const nav_msgs::Odometry& message) {
    const drivers::Motion odometry = tools::motionOf(message);
    if (!drivers::isUsable(odometry) || (newest_ && odometry.stamp <= newest_->stamp)) return;
    before_ = newest_;
    newest_ = odometry;
  }

  // The next motion whose odometry is known.
  std::optional<drivers::Motion> next() {
    while (!waiting_.empty() && newest_ && waiting_.front().stamp <= newest_->stamp) {
      drivers::Motion motion = waiting_.front();
      waiting_.pop_front();
      const bool at_newest = motion.stamp == newest_->stamp;
      if (!at_newest && (!before_ || motion.stamp < before_->stamp)) continue;
      const double share = at_newest ? 1.0
                                     : toSeconds(motion.stamp - before_->stamp) /
                                           toSeconds(newest_->stamp - before_->stamp);
      const drivers::Motion& from = at_newest ? *newest_ : *before_;
      motion.speed = from.speed + share * (newest_->speed - from.speed);
      motion.yaw_rate = from.yaw_rate + share * (newest_->yaw_rate - from.yaw_rate);
      return motion;
    }
    return std::nullopt;
  }

 private:
  std::deque<drivers::Motion> waiting_;
  std::optional<drivers::Motion> last_, before_, newest_;
};

// One bag's way into the data set.
class Extraction {
 public:
  Extraction(const Arguments& arguments, const Setup& setup, std::uint32_t first_tunnel,
             learning::DataWriter& writer)
      : arguments_(arguments),
        sensor_(setup.sensor),
        perception_(setup.perception),
        demonstration_(setup.demonstration, setup.truck),
        tunnel_(first_tunnel),
        writer_(writer) {}

  void run(const std::string& file) {
    rosbag::Bag bag(file, rosbag::bagmode::Read);
    const auto before = writer_.examples();
    readDrive(
        bag, tools::scanTopic(bag, arguments_.topic),
        [&](const sensor_msgs::LaserScan& scan, const ros::Time&) { take(tools::scanOf(scan)); },
        [&](const sensor_msgs::JointState& joints, const ros::Time&) {
          joiner_.take(joints);
          takeMotions();
        },
        [&](const nav_msgs::Odometry& odometry, const ros::Time&) {
          const drivers::Motion motion = tools::motionOf(odometry);
          poses_.add(motion, motion.stamp);  // the recorder's clock may be another
          joiner_.take(odometry);
          takeMotions();
        });
    std::cerr << "extract: " << file << ": " << writer_.examples() - before << " examples of " << scans_
              << " scans, " << static_cast<long>(way_) << " m driven\n";
    for (const auto& [why, count] : left_out_) {
      std::cerr << "extract: " << file << ": " << count << " left out: " << why << "\n";
    }
  }

  std::uint32_t nextTunnel() const { return tunnel_ + 1; }

 private:
  void take(const geometry::Scan& scan) {
    ++scans_;
    const perception::Tunnel* tunnel =
        perception_.update(scan, sensor_, poses_.poseAt(scan.stamp), scan.stamp);
    if (tunnel == nullptr) {
      ++left_out_["scan: " + perception::toString(perception_.filtered().rejection)];
      return;
    }
    std::optional<double> offset;
    if (tunnel->state.valid) offset = tunnel->state.lateral_offset;
    demonstration_.addScan(perception_.filtered().network_scan, offset, tunnel_);
  }

  void takeMotions() {
    while (const std::optional<drivers::Motion> motion = joiner_.next()) {
      demonstration_.addMotion(*motion);
      measureWay(*motion);
    }
    for (learning::Lesson& lesson : demonstration_.take()) write(lesson);
  }

  void measureWay(const drivers::Motion& motion) {
    if (last_motion_) {
      const double passed = std::clamp(toSeconds(motion.stamp - *last_motion_), 0.0, 0.5);
      const double way = std::max(0.0, motion.speed) * passed;
      way_ += way;
      way_in_tunnel_ += way;
    }
    last_motion_ = motion.stamp;
    if (arguments_.tunnel_length == 0.0 || way_in_tunnel_ < arguments_.tunnel_length) return;
    way_in_tunnel_ = 0.0;
    ++tunnel_;
  }

  void write(learning::Lesson& lesson) {
    if (arguments_.correct && !lesson.correction) {
      ++left_out_["the tunnel was not measured long enough to correct it"];
      return;
    }
    if (arguments_.correct) lesson.example.label += *lesson.correction;
    writer_.add(lesson.example);
  }

  const Arguments& arguments_;
  geometry::Pose sensor_;
  simulation::PerceptionChain perception_;
  learning::Demonstration demonstration_;
  drivers::MotionHistory poses_;
  MotionJoiner joiner_;
  std::uint32_t tunnel_;
  learning::DataWriter& writer_;
  std::size_t scans_ = 0;
  double way_ = 0.0;            // [m]
  double way_in_tunnel_ = 0.0;  // [m]
  std::optional<Stamp> last_motion_;
  std::map<std::string, int> left_out_;
};

// The bags that hold a drive. Each is checked in a process of its own, so that one that is damaged ends
// nothing else.
std::vector<std::string> usableBags(const Arguments& arguments) {
  std::vector<std::string> usable;
  for (const std::string& bag : arguments.bags) {
    const int answer = tools::runGuarded("extract: " + bag, [&] {
      checkBag(bag, arguments);
      return tools::kDone;
    });
    if (answer == tools::kDone) {
      usable.push_back(bag);
    } else if (arguments.strict) {
      throw std::runtime_error("ended at " + bag);
    } else {
      std::cerr << "extract: warning: " << bag << " is left out\n";
    }
  }
  if (usable.empty()) throw std::runtime_error("no bag can be used");
  return usable;
}

int extractAll(const Arguments& arguments, const Setup& setup, const std::vector<std::string>& bags) {
  learning::DataWriter writer(arguments.out);
  std::uint32_t tunnel = 0;
  for (const std::string& bag : bags) {
    Extraction extraction(arguments, setup, tunnel, writer);
    extraction.run(bag);
    tunnel = extraction.nextTunnel();
  }
  if (writer.examples() == 0) throw std::runtime_error("nobody drives in these bags");
  writer.finish();
  std::cerr << "extract: " << writer.examples() << " examples of " << tunnel << " tunnels\n";
  return tools::kDone;
}

}  // namespace

int main(int argc, char** argv) {
  tools::limitMemory();
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return tools::kDone;
    const Setup setup = loadSetup(arguments);
    const std::vector<std::string> bags = usableBags(arguments);
    return tools::runGuarded("extract: " + arguments.out,
                             [&] { return extractAll(arguments, setup, bags); });
  } catch (const std::exception& error) {
    std::cerr << "extract: " << error.what() << "\n";
    return tools::kBadInput;
  }
}
