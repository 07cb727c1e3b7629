// A truck that is not ours: it knows nothing but the contract (publish scan, joint_states and odom, obey
// command). It drives, and everything bad that it says ends in a stop that says why.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/TruckCommand.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <functional>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "tunnel_pilot/supervision/command.h"

namespace tunnel_pilot::shell {
namespace {

using supervision::Reason;

constexpr double kStep = 0.005;     // [s]
constexpr int kMotionSteps = 4;     // between two odom and joint_states
constexpr double kFront = 1.95;     // [m] front axle to hinge
constexpr double kRear = 3.17;      // [m]
constexpr double kLidar = 1.6;      // [m] ahead of the front axle
constexpr double kHalfWidth = 2.5;  // [m] of a straight drift without end
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Lidar {
  int beams = 761;
  double view = 190.0;  // [deg]
  int steps = 6;        // from scan to scan
};

void PrintTo(const Lidar& lidar, std::ostream* out) { *out << lidar.beams << " beams"; }

// What the truck says may be spoilt before it is published.
struct Spoil {
  std::function<void(sensor_msgs::LaserScan&)> scan;
  std::function<void(sensor_msgs::JointState&)> joints;
  std::function<void(nav_msgs::Odometry&)> odometry;
  double clock = 0.0;  // [s] added to all times
};

class OwnTruck {
 public:
  OwnTruck()
      : clock_(nh_.advertise<rosgraph_msgs::Clock>("/clock", 10)),
        scan_(nh_.advertise<sensor_msgs::LaserScan>("scan", 10)),
        joints_(nh_.advertise<sensor_msgs::JointState>("joint_states", 10)),
        odometry_(nh_.advertise<nav_msgs::Odometry>("odom", 10)),
        command_(nh_.subscribe<TruckCommand>("command", 50,
                                             [this](const TruckCommand::ConstPtr& m) {
                                               command = *m;
                                               ++commands;
                                               finite = finite && std::isfinite(m->speed) &&
                                                        std::isfinite(m->articulation_angle);
                                             })),
        state_(nh_.subscribe<ArbiterState>("arbiter_state", 50,
                                           [this](const ArbiterState::ConstPtr& m) { state = *m; })),
        diagnostics_(nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 100,
            [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) { keep(*m); })) {}

  // Some time of driving. After each 20 ms the pilot is waited for, as a simulator may do.
  void run(double seconds) {
    const int steps = static_cast<int>(std::lround(seconds / kStep));
    for (int i = 0; i < steps; ++i) step();
  }

  bool runUntil(const std::function<bool()>& done, double seconds) {
    for (double t = 0.0; t < seconds && !done(); t += 4 * kStep) run(4 * kStep);
    return done();
  }

  // A lidar of another kind is another truck: the pilot is told by a jump of the clock, and stops.
  void fit(const Lidar& other) {
    lidar = other;
    time_ += 100.0;
    run(0.1);
    runUntil([this] { return speed < 0.01; }, 5.0);
  }

  bool says(const std::string& stage, const std::string& text) const {
    return std::any_of(told.begin(), told.end(), [&](const std::string& line) {
      return line.find(stage) != std::string::npos && line.find(text) != std::string::npos;
    });
  }

  Lidar lidar;
  Spoil spoil;
  TruckCommand command;
  ArbiterState state;
  int commands = 0;
  bool finite = true;             // all commands so far were
  std::vector<std::string> told;  // /diagnostics, a line a status
  double x = 0.0, y = 0.3, heading = 0.0, articulation = 0.0, speed = 0.0;

 private:
  void keep(const diagnostic_msgs::DiagnosticArray& message) {
    for (const auto& status : message.status) {
      std::string line = status.name + " | " + status.message;
      for (const auto& value : status.values) line += " | " + value.key + "=" + value.value;
      told.push_back(line);
    }
  }

  void step() {
    ++steps_;
    time_ += kStep;
    move();
    rosgraph_msgs::Clock clock;
    clock.clock = now();
    clock_.publish(clock);
    if (steps_ % kMotionSteps == 0) publishMotion();
    if (steps_ % lidar.steps == 0) publishScan();
    ros::spinOnce();
    if (steps_ % kMotionSteps != 0) return;
    const int before = commands;
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(commands > 0 ? 0.5 : 0.02);
    while (commands == before && ros::SteadyTime::now() < end) {
      ros::WallDuration(0.0005).sleep();
      ros::spinOnce();
    }
    awaitAnswer();
  }

  // The proposal of the newest scan comes some milliseconds after it, however busy the machine is.
  void awaitAnswer() {
    if (spoil.scan || spoil.clock != 0.0 || command.stop) return;
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(0.3);
    while (command.header.stamp < last_scan_ && ros::SteadyTime::now() < end) {
      ros::WallDuration(0.0005).sleep();
      ros::spinOnce();
    }
  }

  ros::Time now() const { return ros::Time(time_ + spoil.clock); }

  void move() {
    const double wanted = command.stop || commands == 0 ? 0.0 : command.speed;
    const double most = (command.stop ? 2.2 : command.acceleration) * kStep;
    speed += std::clamp(wanted - speed, -most, most);
    const double rate = std::clamp((command.articulation_angle - articulation) / 0.2, -0.26, 0.26);
    if (commands > 0) rate_ = rate;
    articulation += rate_ * kStep;
    yaw_rate_ =
        (speed * std::sin(articulation) + kRear * rate_) / (kFront * std::cos(articulation) + kRear);
    heading += yaw_rate_ * kStep;
    x += speed * std::cos(heading) * kStep;
    y += speed * std::sin(heading) * kStep;
  }

  void publishMotion() {
    sensor_msgs::JointState joints;
    joints.header.stamp = now();
    joints.name = {"articulation_joint"};
    joints.position = {articulation};
    if (spoil.joints) spoil.joints(joints);
    joints_.publish(joints);
    nav_msgs::Odometry odometry;
    odometry.header.stamp = now();
    odometry.header.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.pose.pose.position.x = x;
    odometry.pose.pose.position.y = y;
    odometry.pose.pose.orientation.z = std::sin(0.5 * heading);
    odometry.pose.pose.orientation.w = std::cos(0.5 * heading);
    odometry.twist.twist.linear.x = speed;
    odometry.twist.twist.angular.z = yaw_rate_;
    if (spoil.odometry) spoil.odometry(odometry);
    odometry_.publish(odometry);
  }

  void publishScan() {
    sensor_msgs::LaserScan scan;
    scan.header.stamp = now();
    scan.header.frame_id = "laser";
    const double view = lidar.view * M_PI / 180.0;
    scan.angle_min = static_cast<float>(-0.5 * view);
    scan.angle_increment = static_cast<float>(view / (lidar.beams - 1));
    scan.angle_max = static_cast<float>(0.5 * view);
    scan.range_min = 0.1F;
    scan.range_max = 40.0F;
    const double across = y + kLidar * std::sin(heading);
    for (int i = 0; i < lidar.beams; ++i) {
      const double angle = heading + scan.angle_min + i * view / (lidar.beams - 1);
      const double wall = std::sin(angle) > 0.0 ? kHalfWidth - across : -kHalfWidth - across;
      const double range = wall / std::sin(angle) + 2e-3 * std::sin(7.0 * i + 1e3 * time_);
      scan.ranges.push_back(range < 40.0 ? static_cast<float>(range) : kInfinity);
    }
    last_scan_ = scan.header.stamp;
    if (spoil.scan) spoil.scan(scan);
    scan_.publish(scan);
  }

  ros::NodeHandle nh_;
  ros::Publisher clock_, scan_, joints_, odometry_;
  ros::Subscriber command_, state_, diagnostics_;
  double time_ = 1000.0;  // [s]
  long steps_ = 0;
  double rate_ = 0.0;      // of the articulation [rad/s]
  double yaw_rate_ = 0.0;  // [rad/s]
  ros::Time last_scan_;
};

// One truck for all tests, as a mine has it.
OwnTruck& truck() {
  static OwnTruck truck;
  return truck;
}

bool reset() {
  std_srvs::Trigger trigger;
  return ros::service::call("arbiter/reset", trigger) && trigger.response.success;
}

void driveOff() {
  truck().spoil = {};
  ASSERT_TRUE(truck().runUntil([] { return truck().commands > 0; }, 60.0)) << "no command ever came";
  // A busy machine may hold up the pilot, which then slows down or stops for a while: time enough to
  // recover.
  for (int i = 0; i < 80 && (truck().speed < 1.5 || truck().command.stop); ++i) {
    truck().run(0.5);
    if (truck().command.stop) reset();
  }
  ASSERT_GE(truck().speed, 1.5) << truck().state.reason_text;
  ASSERT_FALSE(truck().command.stop) << truck().state.reason_text;
}

void expectStop(const std::vector<Reason>& reasons, double within) {
  const auto reason = [] { return static_cast<Reason>(truck().command.reason); };
  ASSERT_TRUE(truck().runUntil([] { return truck().command.stop; }, within))
      << truck().state.reason_text;
  EXPECT_NE(std::find(reasons.begin(), reasons.end(), reason()), reasons.end()) << toString(reason());
  EXPECT_TRUE(truck().runUntil([] { return truck().speed < 0.01; }, 4.0));
  EXPECT_EQ(toString(reason()), truck().state.reason_text);
  EXPECT_TRUE(truck().finite);
  EXPECT_LT(std::abs(truck().y), 0.8);
}

// Before anything but the clock is published.
TEST(OwnTruckBegins, TheArbiterSaysWhatItWaitsFor) {
  const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(60.0);
  const auto told = [] {
    return truck().says("arbiter", "starting up") &&
           truck().says(
               "arbiter",
               "nothing heard yet on=centerline, joint_states, odom, points, tunnel_state, walls");
  };
  while (!told() && ros::SteadyTime::now() < end) {
    ros::spinOnce();
    ros::WallDuration(0.01).sleep();
  }
  EXPECT_TRUE(told());
  EXPECT_FALSE(truck().says("arbiter", "driving"));
}

class OwnTruckTest : public ::testing::Test {
 protected:
  OwnTruckTest() {
    driveOff();
    truck().told.clear();
  }
  ~OwnTruckTest() override { truck().spoil = {}; }
};

TEST_F(OwnTruckTest, DrivesInTheMiddleOfTheDrift) {
  const double start = truck().x;
  truck().run(10.0);
  EXPECT_GT(truck().x - start, 20.0);
  EXPECT_LT(std::abs(truck().y), 0.1);
  EXPECT_FALSE(truck().command.stop) << truck().state.reason_text;
}

TEST_F(OwnTruckTest, AStopIsKeptUntilTheOperatorsReset) {
  std_srvs::Trigger trigger;
  ASSERT_TRUE(ros::service::call("arbiter/stop", trigger));
  expectStop({Reason::kOperatorStop}, 0.1);
  truck().run(2.0);
  EXPECT_TRUE(truck().command.stop);
  EXPECT_TRUE(reset());
  EXPECT_TRUE(truck().runUntil([] { return truck().speed > 1.0; }, 5.0)) << truck().state.reason_text;
}

TEST_F(OwnTruckTest, AGapInTheScansSlowsDownAndTheTruckDrivesOn) {
  truck().spoil.scan = [](auto& scan) { scan.ranges.clear(); };
  truck().run(0.2);
  truck().spoil = {};
  truck().run(0.1);
  EXPECT_FALSE(truck().command.stop) << truck().state.reason_text;
  truck().run(2.0);
  EXPECT_FALSE(truck().command.stop) << truck().state.reason_text;
}

class LidarTest : public OwnTruckTest, public ::testing::WithParamInterface<Lidar> {};

TEST_P(LidarTest, OfAnotherGeometryDrivesAsWell) {
  truck().fit(GetParam());
  driveOff();
  truck().run(5.0);
  EXPECT_FALSE(truck().command.stop) << truck().state.reason_text;
  EXPECT_LT(std::abs(truck().y), 0.15);
  truck().fit({});
}

INSTANTIATE_TEST_SUITE_P(All, LidarTest,
                         ::testing::Values(Lidar{541, 270.0, 8}, Lidar{361, 180.0, 6},
                                           Lidar{1081, 270.0, 5}));

TEST_F(OwnTruckTest, AClockThatJumpsBackStopsAndTheTruckDrivesAgain) {
  truck().spoil.clock = -30.0;
  expectStop({Reason::kClockJump}, 0.3);
  truck().fit(truck().lidar);  // and ahead again
  driveOff();
}

// ---- what is bad in a scan, in joint_states, in odom

struct Bad {
  const char* stage;  // that tells it on /diagnostics
  const char* told;
  std::vector<Reason> reasons;
  Spoil spoil;
};

void PrintTo(const Bad& bad, std::ostream* out) { *out << bad.told; }

void fill(sensor_msgs::LaserScan& scan, float value) {
  std::fill(scan.ranges.begin(), scan.ranges.end(), value);
}

Spoil onScan(std::function<void(sensor_msgs::LaserScan&)> spoil) {
  return {std::move(spoil), {}, {}, 0.0};
}
Spoil onJoints(std::function<void(sensor_msgs::JointState&)> spoil) {
  return {{}, std::move(spoil), {}, 0.0};
}
Spoil onOdometry(std::function<void(nav_msgs::Odometry&)> spoil) {
  return {{}, {}, std::move(spoil), 0.0};
}

class BadInputTest : public OwnTruckTest, public ::testing::WithParamInterface<Bad> {};

TEST_P(BadInputTest, IsToldAndStops) {
  const Bad& bad = GetParam();
  truck().spoil = bad.spoil;
  expectStop(bad.reasons, 0.7);
  EXPECT_TRUE(truck().runUntil([&] { return truck().says(bad.stage, bad.told); }, 30.0)) << bad.told;
  truck().spoil = {};
  truck().run(1.0);
  EXPECT_TRUE(truck().command.stop) << "a stop is not ended by recovery";
}

const std::vector<Reason> kRejected = {Reason::kScanRejected};
const std::vector<Reason> kFrozen = {Reason::kScanFrozen};
// In simulated time a stamp ahead is waited for, so that scans are rejected more seldom than told of.
const std::vector<Reason> kRejectedOrStale = {Reason::kScanRejected, Reason::kScanStale};
const std::vector<Reason> kRejectedOrFrozen = {Reason::kScanRejected, Reason::kScanFrozen};
const std::vector<Reason> kNoMotion = {Reason::kMotionStale};

INSTANTIATE_TEST_SUITE_P(
    Scan, BadInputTest,
    ::testing::Values(
        Bad{"scan_filter", "suit the angles", kRejected, onScan([](auto& s) { s.ranges.resize(300); })},
        Bad{"scan_filter", "suit the angles", kRejected, onScan([](auto& s) { s.ranges.clear(); })},
        Bad{"scan_filter", "suit the angles", kRejected,
            onScan([](auto& s) { s.ranges.resize(1000000, 2.F); })},
        Bad{"scan_filter", "every range is NaN", kRejected,
            onScan([](auto& s) { fill(s, float(kNan)); })},
        Bad{"scan_filter", "every range is infinite", kRejected,
            onScan([](auto& s) { fill(s, kInfinity); })},
        Bad{"scan_filter", "every range is infinite", kRejected,
            onScan([](auto& s) { fill(s, -kInfinity); })},
        Bad{"scan_filter", "negative range", kRejected, onScan([](auto& s) { fill(s, -3.0F); })},
        Bad{"scan_filter", "no return", kRejectedOrFrozen, onScan([](auto& s) { fill(s, 0.0F); })},
        Bad{"scan_filter", "frozen", kFrozen, onScan([first = std::vector<float>()](auto& s) mutable {
              if (first.empty()) first = s.ranges;
              s.ranges = first;
            })},
        Bad{"scan_filter", "future", kRejectedOrStale,
            onScan([](auto& s) { s.header.stamp += ros::Duration(5.0); })},
        Bad{"scan_filter", "before the last", kRejected,
            onScan([](auto& s) { s.header.stamp -= ros::Duration(5.0); })},
        Bad{"scan_filter", "before the last", kRejected,
            onScan([](auto& s) { s.header.stamp = ros::Time(); })},
        Bad{"scan_filter", "geometry differs", kRejected, onScan([](auto& s) { s.range_max = 30.0F; })},
        Bad{"scan_filter", "geometry differs", kRejected, onScan([](auto& s) {
              s.ranges.resize(541);
              s.angle_increment = (s.angle_max - s.angle_min) / 540.0F;
            })},
        Bad{"scan_filter", "make no sense", kRejected,
            onScan([](auto& s) { s.angle_increment = 0.0F; })},
        Bad{"scan_filter", "make no sense", kRejected,
            onScan([](auto& s) { s.angle_min = float(kNan); })},
        Bad{"scan_filter", "frame changed", kRejected,
            onScan([](auto& s) { s.header.frame_id = "elsewhere"; })}));

INSTANTIATE_TEST_SUITE_P(
    Motion, BadInputTest,
    ::testing::Values(
        Bad{"arbiter", "no motion", kNoMotion, onJoints([](auto& j) { j.position[0] = kNan; })},
        Bad{"arbiter", "no motion", kNoMotion, onJoints([](auto& j) { j.velocity = {kNan}; })},
        Bad{"arbiter", "no motion", kNoMotion, onJoints([](auto& j) { j.position.clear(); })},
        Bad{"arbiter", "no motion", kNoMotion, onJoints([](auto& j) { j.name = {"wheel"}; })},
        Bad{"arbiter", "no motion", kNoMotion, onJoints([](auto& j) { j.header.stamp = ros::Time(); })},
        Bad{"arbiter", "no motion", kNoMotion,
            onOdometry([](auto& o) { o.twist.twist.linear.x = kNan; })},
        Bad{"arbiter", "no motion", kNoMotion,
            onOdometry([](auto& o) { o.pose.pose.position.y = kNan; })},
        Bad{"arbiter", "no motion", kNoMotion,
            onOdometry([](auto& o) { o.pose.pose.orientation.w = kNan; })},
        Bad{"arbiter", "no motion", kNoMotion,
            onOdometry([](auto& o) { o.twist.twist.angular.z = -kInfinity; })},
        Bad{"arbiter", "no motion", kNoMotion,
            onOdometry([](auto& o) { o.header.stamp -= ros::Duration(10.0); })}));

TEST_F(OwnTruckTest, MotionThatIsNoNumberStopsAtOnceAndIsCounted) {
  truck().spoil = onOdometry([](auto& o) { o.twist.twist.linear.x = kNan; });
  EXPECT_TRUE(truck().runUntil([] { return truck().command.stop; }, 0.06)) << "0.1 s is silence's";
  EXPECT_TRUE(truck().runUntil([] { return truck().says("arbiter", "motion refused=1"); }, 30.0));
}

TEST_F(OwnTruckTest, ASecondPublisherOfScansStops) {
  const std::string topic = ros::names::resolve("scan");
  const pid_t rogue = fork();
  if (rogue == 0) {
    execlp("rostopic", "rostopic", "pub", "-s", "-r", "10", topic.c_str(), "sensor_msgs/LaserScan", "{}",
           nullptr);
    _exit(127);
  }
  EXPECT_TRUE(truck().runUntil([] { return truck().command.stop; }, 300.0));
  EXPECT_EQ(static_cast<int>(Reason::kScanRejected), truck().command.reason);
  EXPECT_TRUE(truck().runUntil(
      [] { return truck().says("scan_filter", "more than one node publishes"); }, 30.0));
  kill(rogue, SIGKILL);
  waitpid(rogue, nullptr, 0);
  EXPECT_TRUE(truck().runUntil([] { return truck().speed < 0.01; }, 5.0));
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "own_truck_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
