#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/JointState.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "program.h"
#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/drivers/preview_parameters.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot {
namespace {

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;
constexpr double kDegree = 0.017453292519943295;

// A truck whose hydraulics are other than what the pilot's files believe.
constexpr double kDeadTime = 0.18;
constexpr double kRate = 12.5 * kDegree;
constexpr double kIdleRate = 8.0 * kDegree;
constexpr double kLag = 0.23;

vehicle::TruckParameters otherTruck() {
  vehicle::TruckParameters truck = vehicle::loadTruck(kPackage + "/config/truck.yaml");
  truck.steering.dead_time = kDeadTime;
  truck.steering.max_rate = kRate;
  truck.steering.idle_rate = kIdleRate;
  truck.steering.lag = kLag;
  return truck;
}

struct Recorded {
  double seconds = 100.0;
  double speed = 1.5;  // [m/s]
  double size = 5.0 * kDegree;
  std::uint8_t state = TruckStatus::STATE_ACTIVE;
  bool by_hand = false;  // from lock to lock
  bool odometry = true;
};

// A drive on the dynamic plant. A command takes effect 15 ms after it is recorded, a reading is recorded
// 20 ms after it is true.
void record(const std::string& name, const Recorded& drive) {
  vehicle::DynamicTruckOptions options;
  options.load = vehicle::Load::kEmpty;
  vehicle::DynamicTruck plant(otherTruck(), options);
  plant.reset({}, 0.0, drive.speed);
  simulation::Random random(1, simulation::Stream::kArticulation);
  rosbag::Bag file(name, rosbag::bagmode::Write);
  std::deque<double> commands(15, 0.0), readings(20, 0.0);
  double command = 0.0;
  for (int i = 0; i < static_cast<int>(1000.0 * drive.seconds); ++i) {
    const ros::Time time(1000 + i / 1000, static_cast<std::uint32_t>(i % 1000) * 1000000U);
    const double side = i / 1700 % 2 == 0 ? 1.0 : -1.0;
    const double wanted = drive.by_hand ? (i / 12000 % 2 == 0 ? 40.0 : -40.0) * kDegree
                                        : side * drive.size * (i / 3400 % 2 == 0 ? 1.0 : 0.4);
    if (i % 20 == 0) {
      const double most = drive.by_hand ? 2.0 : 0.02 * 15.0 * kDegree;
      command += std::clamp(wanted - command, -most, most);
      TruckCommand message;
      message.articulation_angle = command;
      file.write("/command", time, message);
      TruckStatus status;
      status.state = drive.state;
      file.write("/truck_status", time, status);
      nav_msgs::Odometry odometry;
      odometry.twist.twist.linear.x = drive.speed;
      if (drive.odometry) file.write("/odom", time, odometry);
    }
    commands.push_back(command);
    readings.push_back(plant.state().articulation + 0.003);
    if (i % 20 == 7) {
      sensor_msgs::JointState joints;
      joints.header.stamp = time;
      joints.name = {"wheel", "articulation_joint"};
      joints.position = {7.0, readings.front() + 0.1 * kDegree * random.normal()};
      file.write("/joint_states", time, joints);
    }
    plant.step({commands.front(), std::clamp(drive.speed - plant.state().speed, -1.0, 0.8) + 0.2}, {},
               0.001);
    commands.pop_front();
    readings.pop_front();
  }
}

Outcome identify(const std::vector<std::string>& arguments) {
  return runProgram(IDENTIFY_STEERING_PROGRAM, arguments);
}

class IdentifySteering : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    bags_ = new Workplace;
    record(bag("drive.bag"), {});
  }
  static void TearDownTestSuite() { delete bags_; }
  static std::string bag(const std::string& name) { return bags_->file(name); }

  void SetUp() override {
    std::filesystem::create_directories(place_.file("networks"));
    std::filesystem::create_directories(place_.file("config"));
    for (const std::string& name : kFiles) {
      std::filesystem::copy_file(kPackage + "/config/" + name, file(name));
    }
  }

  std::string file(const std::string& name) const { return place_.file("config/" + name); }

  std::vector<std::string> writing(std::vector<std::string> arguments) const {
    arguments.emplace_back("--write");
    for (const std::string& name : kFiles) arguments.push_back(file(name));
    return arguments;
  }

  void expectUntouched() const {
    for (const std::string& name : kFiles) {
      EXPECT_EQ(contentOf(file(name)), contentOf(kPackage + "/config/" + name)) << name;
    }
    EXPECT_EQ(contentsBelow(place_.file("config")).size(), kFiles.size()) << "something was left over";
  }

  inline static const std::vector<std::string> kFiles = {"can_bridge.yaml", "preview_driver.yaml",
                                                         "lidar_driver.yaml"};
  inline static Workplace* bags_ = nullptr;
  Workplace place_;
};

TEST_F(IdentifySteering, WritesTheTruckIntoTheFilesThatBelieveInIt) {
  const Outcome outcome = identify(writing({bag("drive.bag")}));
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  const bridge::TrackingParameters tracking =
      bridge::loadBridge(config::loadFile(file("can_bridge.yaml"))).tracking;
  EXPECT_NEAR(tracking.dead_time, kDeadTime, 0.02) << outcome.output;
  EXPECT_NEAR(tracking.max_rate, kRate, 0.05 * kRate);
  EXPECT_NEAR(tracking.lag, kLag, 0.1 * kLag);
  EXPECT_EQ(tracking.min_rate, 0.15708);
  const auto preview =
      drivers::loadPreviewDriver(config::loadFile(file("preview_driver.yaml")), place_.file("config"));
  const auto lidar =
      drivers::loadLidarDriver(config::loadFile(file("lidar_driver.yaml")), place_.file("config"));
  for (const drivers::SteeringEstimatorParameters* steering :
       {&preview.truck.steering, &lidar.steering}) {
    EXPECT_EQ(steering->dead_time, tracking.dead_time);
    EXPECT_EQ(steering->max_rate, tracking.max_rate);
    EXPECT_NEAR(steering->lag, tracking.lag + 0.06, 1e-9) << "bodies and tyres add to it";
  }
}

TEST_F(IdentifySteering, OnlyTheNumbersOfTheFilesChange) {
  ASSERT_EQ(identify(writing({bag("drive.bag")})).status, 0);
  for (const std::string& name : kFiles) {
    std::istringstream before(contentOf(kPackage + "/config/" + name)), after(contentOf(file(name)));
    std::string old_line, new_line;
    int changed = 0;
    while (std::getline(before, old_line)) {
      ASSERT_TRUE(std::getline(after, new_line));
      EXPECT_EQ(old_line.find('#'), new_line.find('#')) << new_line;
      if (old_line == new_line) continue;
      ++changed;
      EXPECT_EQ(old_line.substr(old_line.find('#')), new_line.substr(new_line.find('#')));
      EXPECT_EQ(old_line.substr(0, old_line.find(':')), new_line.substr(0, new_line.find(':')));
    }
    EXPECT_FALSE(std::getline(after, new_line));
    EXPECT_EQ(changed, 3) << name;
  }
}

TEST_F(IdentifySteering, ALinkStaysALinkAndPermissionsStay) {
  const std::string link = place_.file("link.yaml");
  std::filesystem::create_symlink(file("can_bridge.yaml"), link);
  std::filesystem::permissions(file("can_bridge.yaml"), std::filesystem::perms(0640));
  ASSERT_EQ(identify({bag("drive.bag"), "--write", link}).status, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(std::filesystem::status(link).permissions(), std::filesystem::perms(0640));
  EXPECT_NE(contentOf(link), contentOf(kPackage + "/config/can_bridge.yaml"));
}

TEST_F(IdentifySteering, TellsTheSidesApart) {
  const Outcome outcome = identify({bag("drive.bag")});
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  for (const char* told :
       {"both", "left", "right", "dead time [s]", "rate [rad/s]", "lag [s]", "steps", "residual"}) {
    EXPECT_NE(outcome.output.find(told), std::string::npos) << told << ":\n" << outcome.output;
  }
}

TEST_F(IdentifySteering, SweepsByHandTellTheRates) {
  Recorded hand;
  hand.by_hand = true;
  hand.state = TruckStatus::STATE_STANDBY;
  record(bag("sweeps.bag"), hand);
  hand.speed = 0.0;
  record(bag("idle.bag"), hand);
  const Outcome outcome = identify({"--sweeps", bag("sweeps.bag"), "--idle-sweeps", bag("idle.bag"),
                                    "--write", file("can_bridge.yaml"), file("preview_driver.yaml")});
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  const auto tracking = bridge::loadBridge(config::loadFile(file("can_bridge.yaml"))).tracking;
  EXPECT_NEAR(tracking.max_rate, kRate, 0.05 * kRate);
  EXPECT_NEAR(tracking.min_rate, kIdleRate, 0.05 * kIdleRate);
  EXPECT_EQ(tracking.dead_time, 0.15) << "nothing was told about it";
}

TEST_F(IdentifySteering, WhatTheBagCannotTellIsSaidAndNothingIsWritten) {
  Recorded drive;
  drive.state = TruckStatus::STATE_STANDBY;
  record(bag("standby.bag"), drive);
  drive = {};
  drive.speed = 0.5;  // the engine is not at working speed
  drive.seconds = 30.0;
  record(bag("slow.bag"), drive);
  drive = {};
  drive.size = 1.0 * kDegree;
  record(bag("even.bag"), drive);
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"standby.bag", "too short"}, {"slow.bag", "too short"}, {"even.bag", "too evenly"}};
  for (const auto& [name, told] : cases) {
    const Outcome outcome = identify(writing({bag(name)}));
    EXPECT_EQ(outcome.status, 1) << name << ": " << outcome.output;
    EXPECT_NE(outcome.output.find(told), std::string::npos) << outcome.output;
    expectUntouched();
  }
}

TEST_F(IdentifySteering, AFileThatWouldNotLoadLeavesAllAsTheyWere) {
  std::string text = contentOf(file("can_bridge.yaml"));
  const std::string lowest = "min_rate: 0.15708";
  text.replace(text.find(lowest), lowest.size(), "min_rate: 0.24   ");  // above what will be measured
  std::ofstream(file("other.yaml")) << text;
  const Outcome outcome =
      identify({bag("drive.bag"), "--write", file("preview_driver.yaml"), file("other.yaml")});
  EXPECT_EQ(outcome.status, 2) << outcome.output;
  EXPECT_NE(outcome.output.find("min_rate"), std::string::npos) << outcome.output;
  EXPECT_EQ(contentOf(file("other.yaml")), text);
  std::filesystem::remove(file("other.yaml"));
  expectUntouched();
}

TEST_F(IdentifySteering, BadArgumentsExitTwoAndSayWhy) {
  Recorded drive;
  drive.odometry = false;
  drive.seconds = 1.0;
  record(bag("odomless.bag"), drive);
  std::ofstream(bag("text.bag")) << "no bag";
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{}, "no bag"},
      {{bag("none.bag")}, "no such file"},
      {{bag("odomless.bag")}, "odom"},
      {{bag("text.bag")}, "identify_steering"},
      {{bag("drive.bag"), "--colour"}, "colour"},
      {{bag("drive.bag"), "--config", place_.file("none")}, "none"},
      {{bag("drive.bag"), "--write", kPackage + "/config/truck.yaml"}, "truck.yaml"},
      {{bag("drive.bag"), "--write", place_.file("none.yaml")}, "none.yaml"},
  };
  for (const auto& [arguments, told] : cases) {
    const Outcome outcome = identify(arguments);
    EXPECT_EQ(outcome.status, 2) << told << ": " << outcome.output;
    EXPECT_NE(outcome.output.find(told), std::string::npos) << outcome.output;
  }
}

}  // namespace
}  // namespace tunnel_pilot
