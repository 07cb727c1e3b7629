#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "program.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/learning/data_file.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/simulator.h"
#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot {
namespace {

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;
constexpr double kOffset = 0.3;  // the truck drives so far left of the middle of a straight drift [m]

Outcome extract(const std::vector<std::string>& arguments) {
  return runProgram(EXTRACT_PROGRAM, arguments);
}

// What a recorded drive is like.
struct Recorded {
  double duration = 8.0;  // [s]
  double speed = 3.0;     // [m/s]
  bool joints = true, odometry = true;
  std::string joint = "articulation_joint";
  std::string scan_topic = "/scan";
  double jump_at = -1.0;     // the stamps go back by 20 s there [s]
  double held_up_at = -1.0;  // what is sent in the 1.5 s from there on is recorded at their end [s]
  int fewer_beams = 0;       // of the second half's scans
};

// Articulation of the recorded drive [rad], so small that the straight way does not contradict.
double articulationAt(double time) { return 0.01 * std::sin(time); }

class Extract : public ::testing::Test {
 protected:
  void SetUp() override { record("drive.bag", {}); }

  std::string bag(const std::string& name = "drive.bag") const { return place_.file(name); }
  std::string out() const { return place_.file("drives.tpds"); }

  void record(const std::string& name, const Recorded& drive) const {
    const auto parameters =
        simulation::loadSimulator(config::loadFile(kPackage + "/config/simulator.yaml")).lidar;
    const world::RayCaster caster({{{-50.0, 2.5}, {120.0, 2.5}}, {{-50.0, -2.5}, {120.0, -2.5}}},
                                  simulation::LidarModel::beams(parameters));
    simulation::LidarModel lidar(parameters, 1000);
    rosbag::Bag file(bag(name), rosbag::bagmode::Write);
    const int ticks = static_cast<int>(50.0 * drive.duration);
    for (int i = 0; i < ticks; ++i) {
      const double time = 0.02 * i;
      const double held_up_until = drive.held_up_at + 1.5;
      const bool held_up = drive.held_up_at >= 0.0 && time >= drive.held_up_at && time < held_up_until;
      const ros::Time recorded(1000.0 + (held_up ? held_up_until : time));
      const bool jumped = drive.jump_at >= 0.0 && time >= drive.jump_at;
      const ros::Time stamp(jumped ? 980.0 + time : 1000.0 + time);
      if (drive.odometry) {
        nav_msgs::Odometry odometry;
        odometry.header.stamp = stamp;
        odometry.pose.pose.position.x = drive.speed * time;
        odometry.pose.pose.orientation.w = 1.0;
        odometry.twist.twist.linear.x = drive.speed;
        file.write("/odom", recorded, odometry);
      }
      if (drive.joints) {
        sensor_msgs::JointState joints;
        joints.header.stamp = stamp;
        joints.name = {"wheel", drive.joint};
        joints.position = {7.0, articulationAt(time)};
        file.write("/joint_states", recorded, joints);
      }
      if (i % 2 != 0) continue;
      const geometry::Pose sensor{drive.speed * time + 1.6, kOffset, 0.0};
      const geometry::Scan& scan = lidar.sweep(caster, sensor, sensor, 1.5, 0.0, Stamp(i));
      sensor_msgs::LaserScan message;
      message.header.stamp = stamp;
      message.angle_min = static_cast<float>(scan.angle_min);
      message.angle_increment = static_cast<float>(scan.angle_increment);
      message.range_min = static_cast<float>(scan.range_min);
      message.range_max = static_cast<float>(scan.range_max);
      message.ranges = scan.ranges;
      if (2 * i > ticks) message.ranges.resize(scan.ranges.size() - drive.fewer_beams);
      message.angle_max =
          message.angle_min + message.angle_increment * static_cast<float>(message.ranges.size() - 1);
      file.write(drive.scan_topic, recorded, message);
    }
  }

  Workplace place_;
};

TEST_F(Extract, LabelsEachScanWithTheArticulationAfterTheDelays) {
  const Outcome outcome = extract({"--out", out(), bag()});
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  const learning::DataSet data = learning::readDataSet(out());
  ASSERT_GT(data.size(), 150U);
  // Scans come every 0.04 s; the first is the bag's first.
  for (std::size_t i = 0; i < data.size(); ++i) {
    const double time = 0.04 * static_cast<double>(i);
    EXPECT_NEAR(data[i].articulation, articulationAt(time + 0.04), 2e-5);
    EXPECT_NEAR(data[i].articulation_ahead, articulationAt(time + 0.04 + 0.165), 2e-5);
    EXPECT_NEAR(data[i].label, articulationAt(time + 0.04 + 0.165 + 0.26), 2e-5);
    EXPECT_FLOAT_EQ(data[i].speed, 3.0F);
    EXPECT_NEAR(data[i].ranges[20], (2.5 + kOffset) / std::cos(5.0 / 57.29578 - 20 * 0.0043633231), 0.2);
  }
}

TEST_F(Extract, AnotherDelayGivesOtherLabels) {
  ASSERT_EQ(extract({"--out", out(), "--delay", "0.35", "--scan-delay", "0.1", bag()}).status, 0);
  const learning::DataSet data = learning::readDataSet(out());
  EXPECT_NEAR(data[50].label, articulationAt(50 * 0.04 + 0.45), 2e-5);
}

TEST_F(Extract, CorrectedLabelsLeadToTheMiddle) {
  ASSERT_EQ(extract({"--out", out(), "--correct", bag()}).status, 0);
  const learning::DataSet data = learning::readDataSet(out());
  ASSERT_GT(data.size(), 50U);
  for (const learning::Example& example : data) EXPECT_LT(example.label, -0.03F);
}

TEST_F(Extract, ScansThatWereFilteredBeforeWillDo) {
  Recorded drive;
  drive.scan_topic = "scan_filtered";
  record("filtered.bag", drive);
  ASSERT_EQ(extract({"--out", out(), bag("filtered.bag")}).status, 0);
  EXPECT_GT(learning::readDataSet(out()).size(), 150U);
}

TEST_F(Extract, ARecorderThatWasHeldUpIsNoJumpOfTheClock) {
  for (const double at : {0.0, 4.0}) {
    Recorded drive;
    drive.held_up_at = at;
    record("late.bag", drive);
    const Outcome outcome = extract({"--out", out(), bag("late.bag")});
    EXPECT_EQ(outcome.status, 0) << outcome.output;
    EXPECT_GT(learning::readDataSet(out()).size(), 150U);
  }
}

TEST_F(Extract, StandstillAndReverseAreLeftOut) {
  for (const double speed : {0.0, -1.0}) {
    Recorded drive;
    drive.speed = speed;
    record("still.bag", drive);
    const Outcome outcome = extract({"--out", out(), bag("still.bag")});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_NE(outcome.output.find("nobody drives"), std::string::npos) << outcome.output;
    EXPECT_FALSE(std::filesystem::exists(out()));
  }
}

TEST_F(Extract, EachBagAndEachLengthIsATunnel) {
  const auto tunnels = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--out", out()});
    EXPECT_EQ(extract(arguments).status, 0);
    std::set<std::uint32_t> found;
    for (const learning::Example& example : learning::readDataSet(out())) found.insert(example.tunnel);
    return found;
  };
  EXPECT_EQ(tunnels({bag()}), (std::set<std::uint32_t>{0}));
  EXPECT_EQ(tunnels({bag(), bag()}), (std::set<std::uint32_t>{0, 1}));
  EXPECT_EQ(tunnels({"--tunnel-length", "10", bag()}), (std::set<std::uint32_t>{0, 1, 2}));
}

TEST_F(Extract, ABagThatCannotBeUsedIsNamedAndLeftOut) {
  Recorded drive;
  drive.joints = false;
  record("jointless.bag", drive);
  drive = {};
  drive.joint = "hinge";
  record("hinge.bag", drive);
  drive = {};
  drive.odometry = false;
  record("odomless.bag", drive);
  drive = {};
  drive.jump_at = 4.0;
  record("jump.bag", drive);
  drive = {};
  drive.fewer_beams = 10;
  record("mixed.bag", drive);
  std::ofstream(bag("text.bag")) << "no bag";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"jointless.bag", "articulation_joint"},
      {"hinge.bag", "articulation_joint"},
      {"odomless.bag", "odom"},
      {"jump.bag", "jumps"},
      {"mixed.bag", "geometries"},
      {"text.bag", "text.bag"},
      {"none.bag", "no such file"}};
  for (const auto& [name, told] : cases) {
    const Outcome outcome = extract({"--out", out(), bag(name), bag()});
    EXPECT_EQ(outcome.status, 0) << name << ": " << outcome.output;
    EXPECT_NE(outcome.output.find(told), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("warning: " + bag(name)), std::string::npos) << outcome.output;
    EXPECT_GT(learning::readDataSet(out()).size(), 150U);
    std::filesystem::remove(out());
    EXPECT_EQ(extract({"--strict", "--out", out(), bag(), bag(name)}).status, 2) << name;
    EXPECT_FALSE(std::filesystem::exists(out()));
  }
}

TEST_F(Extract, BadArgumentsExitTwoAndSayWhy) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{bag()}, "out"},
      {{"--out", out()}, "bag"},
      {{"--out", bag(), bag()}, "itself"},
      {{"--out", "/dev/null/x", bag()}, "/dev/null/x"},
      {{"--out", out(), "--delay", "-1", bag()}, "--delay"},
      {{"--out", out(), "--delay", "nan", bag()}, "--delay"},
      {{"--out", out(), "--scan-delay", "3", bag()}, "--scan-delay"},
      {{"--out", out(), "--tunnel-length", "1", bag()}, "--tunnel-length"},
      {{"--out", out(), bag(), "--transform", "1", "2"}, "transform"},
      {{"--out", out(), bag(), "--config", place_.file("none")}, "none"},
      {{"--out", out(), bag(), "--topic", "other"}, "other"},
      {{"--out", out(), bag(), "--colour"}, "colour"},
  };
  for (const auto& [arguments, told] : cases) {
    const Outcome outcome = extract(arguments);
    EXPECT_EQ(outcome.status, 2) << told << ": " << outcome.output;
    EXPECT_NE(outcome.output.find(told), std::string::npos) << outcome.output;
  }
}

TEST_F(Extract, ABagWithWrongBytesNeverCrashes) {
  const std::string content = contentOf(bag());
  simulation::Random random(1002, simulation::Stream::kWander);
  for (int i = 0; i < 12; ++i) {
    std::string bad = content;
    const std::size_t range = i % 3 == 0 ? 8192 : i % 3 == 1 ? 4096 : content.size();
    for (int k = 0; k < 8; ++k) {
      const std::size_t at = random.bits() % range;
      bad[i % 3 == 1 ? bad.size() - 1 - at : at] = static_cast<char>(random.bits());
    }
    std::ofstream(bag("bad.bag"), std::ios::binary) << bad;
    const Outcome outcome = extract({"--out", out(), bag("bad.bag")});
    EXPECT_EQ(outcome.signal, 0) << "fault set " << i;
    EXPECT_TRUE(outcome.status == 0 || outcome.status == 2) << outcome.output;
  }
}

}  // namespace
}  // namespace tunnel_pilot
