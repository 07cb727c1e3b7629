// identify_steering: measures from recorded drives how the truck's steering answers, and writes it where
// the pilot believes it. Procedure: docs/commissioning.md.
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/JointState.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "bag_reading.h"
#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/vehicle/steering_fit.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"
#include "yaml_numbers.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;
using vehicle::Estimate;
using vehicle::SteeringFit;
using vehicle::TurnDirection;

constexpr int kNotTold = 1;
constexpr double kDegree = 0.017453292519943295;
constexpr double kGap = 0.15;  // of commands or readings that ends a stretch [s]
// A reading waits for its frame and for whoever takes it: what the recorded articulation is late by [s].
constexpr double kFeedbackDelay = 0.02;
// The drivers' lag is that of the way the truck takes: bodies and tyres add to the hydraulics' [s].
constexpr double kBodiesAndTyres = 0.06;

struct Arguments {
  std::vector<std::string> bags, write;
  std::string sweeps, idle_sweeps, config;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "identify_steering [BAG...]: measures the steering's dead time, rate and lag from drives with "
      "steps\n(steps.launch). A bag must hold command, joint_states, truck_status and odom.\nOptions");
  shown.add_options()("help,h", "this text")("bag", options::value(&arguments.bags)->value_name("FILE"),
                                             "recorded drives; also without the option's name")(
      "sweeps", options::value(&arguments.sweeps)->value_name("BAG"),
      "an operator turned from lock to lock, wheel held over, engine at working speed: the rate")(
      "idle-sweeps", options::value(&arguments.idle_sweeps)->value_name("BAG"),
      "likewise, engine at idle: the lowest rate")("config",
                                                   options::value(&arguments.config)->value_name("DIR"),
                                                   "truck.yaml, can_bridge.yaml and preview_driver.yaml "
                                                   "that the bags were recorded with; without it the "
                                                   "package's own")(
      "write", options::value(&arguments.write)->multitoken()->value_name("FILE..."),
      "can_bridge.yaml, preview_driver.yaml, lidar_driver.yaml: writes what was measured "
      "into them; comments and layout stay");
  options::positional_options_description positional;
  positional.add("bag", -1);
  options::variables_map values;
  options::store(options::command_line_parser(argc, argv).options(shown).positional(positional).run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 measured, 1 the bags cannot tell, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  if (arguments.bags.empty() && arguments.sweeps.empty() && arguments.idle_sweeps.empty()) {
    throw options::error("no bag is named");
  }
  return true;
}

// What the bags were recorded with.
struct Setup {
  vehicle::TruckParameters truck;
  bridge::BridgeParameters bridge;
  drivers::PreviewDriverParameters driver;
};

Setup loadSetup(const std::string& given) {
  const std::string folder = given.empty() ? tools::defaultConfig() : given;
  return {vehicle::loadTruck(folder + "/truck.yaml"),
          bridge::loadBridge(config::loadFile(folder + "/can_bridge.yaml")),
          drivers::loadPreviewDriver(config::loadFile(folder + "/preview_driver.yaml"), folder,
                                     drivers::PreviewLaw::kOptimal)};
}

// Takes a bag's messages by the time of their recording, which one clock tells for all of them, and
// hands on the stretches in which the pilot steered at the engine's working speed.
class Stretches {
 public:
  Stretches(const Setup& setup, vehicle::SteeringIdentification& identification)
      : rate_(setup.bridge.steering_rate),
        working_speed_(setup.truck.steering.working_speed),
        identification_(identification) {}

  void take(const TruckStatus& status) {
    steering_ = status.state == TruckStatus::STATE_ACTIVE || status.state == TruckStatus::STATE_DEGRADED;
    if (!steering_) finish();
  }

  void take(const nav_msgs::Odometry& odometry) {
    fast_ = odometry.twist.twist.linear.x >= working_speed_;
    if (!fast_) finish();
  }

  void take(const TruckCommand& command, double time) {
    if (!steering_ || !fast_ || !measured_) return;
    auto& commands = record_.commanded;
    if (!commands.empty() && time - commands.back().time > kGap) finish();
    const double from = commands.empty() ? command.articulation_angle : commands.back().angle;
    const double most = rate_ * (commands.empty() ? 0.0 : time - commands.back().time);
    const double sent = std::clamp(command.articulation_angle, from - most - kRounding,
                                   from + most + kRounding);  // the bridge sends no faster
    if (!commands.empty() && time <= commands.back().time) {
      commands.back().angle = sent;
    } else {
      commands.push_back({time, sent});
    }
  }

  void takeArticulation(double angle, double time) {
    measured_ = true;
    auto& angles = record_.measured;
    if (!angles.empty() && time - angles.back().time > kGap) finish();
    if (record_.commanded.empty() || (!angles.empty() && time <= angles.back().time)) return;
    angles.push_back({time, angle});
  }

  void finish() {
    identification_.add(record_);
    record_ = {};
  }

 private:
  static constexpr double kRounding = 0.005;  // commands come at times that jitter [rad]
  double rate_;
  double working_speed_;
  vehicle::SteeringIdentification& identification_;
  vehicle::SteeringRecord record_;
  bool steering_ = false, fast_ = false, measured_ = false;
};

template <typename Handle>
void readBag(const std::string& file, const std::vector<std::string>& topics, Handle handle) {
  if (!std::filesystem::is_regular_file(file)) throw std::runtime_error(file + ": no such file");
  rosbag::Bag bag(file, rosbag::bagmode::Read);
  std::vector<std::string> missing = topics;
  rosbag::View view(bag, [&](const rosbag::ConnectionInfo* connection) {
    const auto named = [&](const std::string& topic) {
      return tools::sameTopic(connection->topic, topic);
    };
    missing.erase(std::remove_if(missing.begin(), missing.end(), named), missing.end());
    return std::any_of(topics.begin(), topics.end(), named);
  });
  for (const std::string& topic : missing) throw std::runtime_error(file + ": it holds no " + topic);
  for (const rosbag::MessageInstance& message : view) handle(message);
}

// Index of the articulation in a message, or the number of joints.
std::size_t articulationIn(const sensor_msgs::JointState& joints) {
  const auto at = std::find(joints.name.begin(), joints.name.end(), "articulation_joint");
  return std::min(static_cast<std::size_t>(at - joints.name.begin()), joints.position.size());
}

void readDrive(const std::string& file, const Setup& setup,
               vehicle::SteeringIdentification& identification) {
  Stretches stretches(setup, identification);
  readBag(file, {"command", "joint_states", "truck_status", "odom"},
          [&](const rosbag::MessageInstance& message) {
            const double time = message.getTime().toSec();
            if (const auto command = message.instantiate<TruckCommand>()) {
              stretches.take(*command, time);
            } else if (const auto joints = message.instantiate<sensor_msgs::JointState>()) {
              const std::size_t at = articulationIn(*joints);
              if (at < joints->position.size()) stretches.takeArticulation(joints->position[at], time);
            } else if (const auto status = message.instantiate<TruckStatus>()) {
              stretches.take(*status);
            } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
              stretches.take(*odometry);
            }
          });
  stretches.finish();
}

// The slower side's rate: what the pilot may count on.
Estimate rateOfSweeps(const std::string& file, const char* engine) {
  std::vector<vehicle::TimedAngle> measured;
  readBag(file, {"joint_states"}, [&](const rosbag::MessageInstance& message) {
    const auto joints = message.instantiate<sensor_msgs::JointState>();
    if (!joints) return;
    const std::size_t at = articulationIn(*joints);
    const double time = message.getTime().toSec();
    if (at >= joints->position.size() || (!measured.empty() && time <= measured.back().time)) return;
    measured.push_back({time, joints->position[at]});
  });
  const vehicle::SweepRates rates = vehicle::sweepRates(measured);
  for (const auto& [side, rate] : {std::pair("left", rates.left), std::pair("right", rates.right)}) {
    std::printf("sweeps, engine %s, to the %-5s  ", engine, side);
    if (rate.known()) {
      std::printf("%.4f +- %.4f rad/s (%.2f deg/s)\n", rate.value, rate.deviation, rate.value / kDegree);
    } else {
      std::printf("not told: %s\n", rate.refusal.c_str());
    }
  }
  if (!rates.left.known()) return rates.left;
  if (!rates.right.known()) return rates.right;
  return rates.left.value < rates.right.value ? rates.left : rates.right;
}

std::string cell(const Estimate& estimate) {
  if (!estimate.known()) return "-";
  char text[40];
  std::snprintf(text, sizeof text, "%.4f +- %.4f", estimate.value, estimate.deviation);
  return text;
}

void print(const SteeringFit& both, const SteeringFit& left, const SteeringFit& right) {
  const auto row = [](const char* name, const std::string& a, const std::string& b,
                      const std::string& c) {
    std::printf("%-22s%-20s%-20s%-20s\n", name, a.c_str(), b.c_str(), c.c_str());
  };
  row("", "both", "left", "right");
  row("dead time [s]", cell(both.dead_time), cell(left.dead_time), cell(right.dead_time));
  row("rate [rad/s]", cell(both.rate), cell(left.rate), cell(right.rate));
  row("lag [s]", cell(both.lag), cell(left.lag), cell(right.lag));
  row("steps", std::to_string(both.left + both.right), std::to_string(both.left),
      std::to_string(both.right));
  std::printf(
      "residual %.3f deg RMS of %zu readings; dead band %.2f deg, articulation reads %+.2f deg, ",
      both.residual / kDegree, both.samples, both.dead_band / kDegree, both.bias / kDegree);
  std::printf("the hinge swings at %.1f Hz, damping ratio %.2f\n", both.hinge_frequency,
              both.hinge_damping);
  for (const auto& [name, estimate] : {std::pair("dead time", both.dead_time),
                                       std::pair("rate", both.rate), std::pair("lag", both.lag)}) {
    if (!estimate.known()) std::printf("%s not told: %s\n", name, estimate.refusal.c_str());
  }
}

// What the bags told; NaN what they did not.
struct Measured {
  double dead_time = NAN;  // the hydraulics' own [s]
  double lag = NAN;        // [s]
  double rate = NAN;       // [rad/s]
  double idle_rate = NAN;  // [rad/s]
  bool complete = true;    // all that the bags were made for
};

Measured measure(const Arguments& arguments, const Setup& setup) {
  Measured found;
  if (!arguments.sweeps.empty()) {
    const Estimate rate = rateOfSweeps(arguments.sweeps, "at working speed");
    if (rate.known()) found.rate = rate.value;
    found.complete = found.complete && rate.known();
  }
  if (!arguments.idle_sweeps.empty()) {
    const Estimate rate = rateOfSweeps(arguments.idle_sweeps, "at idle");
    if (rate.known()) found.idle_rate = rate.value;
    found.complete = found.complete && rate.known();
  }
  if (arguments.bags.empty()) return found;
  vehicle::SteeringIdentification identification;
  for (const std::string& bag : arguments.bags) readDrive(bag, setup, identification);
  const SteeringFit fit = identification.fit();
  print(fit, identification.fit(TurnDirection::kLeft), identification.fit(TurnDirection::kRight));
  const double way = setup.driver.truck.steering.transport_delay + kFeedbackDelay;
  if (fit.dead_time.known()) {
    found.dead_time = std::max(0.0, fit.dead_time.value - way);
    std::printf(
        "of the dead time, the command and the reading are on their way for %.3f s: %.4f s are the "
        "hydraulics'\n",
        way, found.dead_time);
  }
  if (fit.lag.known()) found.lag = fit.lag.value;
  if (fit.rate.known() && !(found.rate < fit.rate.value)) found.rate = fit.rate.value;
  found.complete = found.complete && fit.dead_time.known() && fit.lag.known();
  return found;
}

std::string contentOf(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw std::runtime_error("cannot read '" + file + "'");
  return text.str();
}

enum class Belief { kBridge, kPreviewDriver, kLidarDriver };

// A file tells by its keys what it is.
Belief beliefIn(const std::string& file) {
  const YAML::Node yaml = YAML::LoadFile(file);
  if (yaml["tracking"] && yaml["steering_rate"]) return Belief::kBridge;
  if (yaml["steering"] && yaml["law"]) return Belief::kPreviewDriver;
  if (yaml["steering"] && yaml["mirror"]) return Belief::kLidarDriver;
  throw std::runtime_error("'" + file +
                           "' is no can_bridge.yaml, preview_driver.yaml or lidar_driver.yaml");
}

void load(const std::string& file, Belief belief) {
  const std::string folder = std::filesystem::path(file).parent_path().string();
  const config::Node node = config::loadFile(file);
  if (belief == Belief::kBridge) bridge::loadBridge(node);
  if (belief == Belief::kPreviewDriver) drivers::loadPreviewDriver(node, folder);
  if (belief == Belief::kLidarDriver) drivers::loadLidarDriver(node, folder);
}

tools::NewFile newFile(const std::string& file, const Measured& measured, const Setup& setup) {
  const Belief belief = beliefIn(file);
  const bool is_bridge = belief == Belief::kBridge;
  const std::string map = is_bridge ? "tracking" : "steering";
  std::vector<tools::YamlNumber> numbers;
  const auto set = [&](const char* key, double value) {
    if (std::isfinite(value)) numbers.push_back({map, key, std::round(value * 1e4) * 1e-4});
  };
  set("dead_time", measured.dead_time);
  set("lag", is_bridge ? measured.lag : measured.lag + kBodiesAndTyres);
  // A driver may not plan with more than the bridge lets through, however fast the truck is.
  set("max_rate", is_bridge ? measured.rate : std::min(measured.rate, setup.bridge.steering_rate));
  if (is_bridge) set("min_rate", measured.idle_rate);
  for (const tools::YamlNumber& number : numbers) {
    std::printf("%s: %s.%s: %g\n", file.c_str(), map.c_str(), number.key.c_str(), number.value);
  }
  return {file, tools::withNumbers(contentOf(file), numbers),
          [belief](const std::string& written) { load(written, belief); }};
}

int identify(const Arguments& arguments) {
  const Setup setup = loadSetup(arguments.config);
  for (const std::string& file : arguments.write) load(file, beliefIn(file));
  const Measured measured = measure(arguments, setup);
  if (!measured.complete) {
    std::cerr << "identify_steering: not everything was told; nothing was written\n";
    return kNotTold;
  }
  std::vector<tools::NewFile> files;
  for (const std::string& file : arguments.write) files.push_back(newFile(file, measured, setup));
  tools::replaceFiles(files);
  return tools::kDone;
}

}  // namespace

int main(int argc, char** argv) {
  tools::limitMemory();
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return tools::kDone;
    return tools::runGuarded("identify_steering", [&] {
      std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);
      try {
        return identify(arguments);
      } catch (const vehicle::CannotTell& error) {
        std::cerr << "identify_steering: " << error.what() << "; nothing was written\n";
        return kNotTold;
      }
    });
  } catch (const std::exception& error) {
    std::cerr << "identify_steering: " << error.what() << "\n";
    return tools::kBadInput;
  }
}
