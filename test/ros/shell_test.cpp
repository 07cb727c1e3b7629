// What the shells do without a ROS master: conversions, parameter trees, clocks, pairing of topics.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/ros/bus_tap.h"
#include "tunnel_pilot/ros/clock_watch.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/motion_input.h"
#include "tunnel_pilot/ros/parameters.h"
#include "tunnel_pilot/ros/publisher_watch.h"
#include "tunnel_pilot/ros/run_info.h"
#include "tunnel_pilot/ros/self_check.h"
#include "tunnel_pilot/ros/sensor_pose.h"
#include "tunnel_pilot/ros/status_line.h"
#include "tunnel_pilot/ros/status_text.h"
#include "tunnel_pilot/ros/stopping_markers.h"

namespace tunnel_pilot::shell {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

config::Node nodeOf(const XmlRpc::XmlRpcValue& tree) { return {toYaml(tree, "here"), "here"}; }

XmlRpc::XmlRpcValue tree(const XmlRpc::XmlRpcValue& value) {
  XmlRpc::XmlRpcValue map;
  map["key"] = value;
  return map;
}

TEST(ParameterTree, WholeNumberPassesForANumber) {
  EXPECT_EQ(3.0, nodeOf(tree(3)).number("key", "m", 0.0, 10.0));
}

TEST(ParameterTree, NumberKeepsAllItsDigits) {
  const double value = 0.1 + 1e-15;
  EXPECT_EQ(value, nodeOf(tree(value)).number("key", "m", 0.0, 10.0));
}

TEST(ParameterTree, NumberIsToldInAsFewDigitsAsItNeeds) {
  EXPECT_EQ("0.1", toYaml(XmlRpc::XmlRpcValue(0.1), "here").Scalar());
}

TEST(ParameterTree, NumberWithoutFractionIsNoWholeNumber) {
  EXPECT_THROW(nodeOf(tree(3.0)).integer("key", "1", 0, 10), config::ConfigError);
}

TEST(ParameterTree, TextOfDigitsIsNoNumber) {
  EXPECT_THROW(nodeOf(tree("3")).number("key", "m", 0.0, 10.0), config::ConfigError);
}

TEST(ParameterTree, NumberIsNoFlag) {
  EXPECT_THROW(nodeOf(tree(1)).boolean("key"), config::ConfigError);
}

TEST(ParameterTree, NanIsRefused) {
  EXPECT_THROW(nodeOf(tree(kNan)).number("key", "m", 0.0, 10.0), config::ConfigError);
}

TEST(ParameterTree, ListsAndMapsNest) {
  XmlRpc::XmlRpcValue inner;
  inner[0]["name"] = "first";
  inner[1]["name"] = "second";
  auto children = nodeOf(tree(inner)).children("key");
  ASSERT_EQ(2u, children.size());
  EXPECT_EQ("second", children[1].text("name"));
}

TEST(Stamps, PassToTheNanosecond) {
  const ros::Time time(1700000000, 123456789);
  EXPECT_EQ(time, toRos(toCore(time)));
  EXPECT_EQ(1700000000123456789LL, toCore(time).count());
}

// ros::Time subtracts to 68 years at most, and throws beyond.
TEST(Stamps, AMessageStampedHoweverFarAheadIsNotWaitedFor) {
  ros::Time::init();
  ros::Time::setNow(ros::Time(1000, 0));
  const ros::SteadyTime before = ros::SteadyTime::now();
  for (const std::uint32_t second : {1001U, 2000000000U, 4294967295U}) {
    EXPECT_EQ(nowAfter(ros::Time(second, 0)), std::chrono::seconds(1000)) << second;
  }
  EXPECT_LT((ros::SteadyTime::now() - before).toSec(), 0.05);
  ros::Time::init();  // no simulated time for the tests that follow
}

TEST(Conversions, ScanComesBackUnchanged) {
  sensor_msgs::LaserScan message;
  message.header.stamp = ros::Time(5, 7);
  message.angle_min = -1.5F;
  message.angle_increment = 0.01F;
  message.range_max = 30.0F;
  message.ranges = {1.0F, std::numeric_limits<float>::infinity(), 2.5F};
  const auto back = toRos(toCore(message), "laser");
  EXPECT_EQ(message.header.stamp, back.header.stamp);
  EXPECT_EQ(message.angle_min, back.angle_min);
  EXPECT_EQ(message.angle_increment, back.angle_increment);
  EXPECT_EQ(message.ranges, back.ranges);
}

TEST(Conversions, PathKeepsItsCurvatureThroughAMessage) {
  const auto path = geometry::buildPath({{10.0, 0.0, 0.08}, {10.0, 0.08, 0.08}}, {1.0, 2.0, 0.3}, 0.5);
  const auto back = toCore(toRos(path, Stamp{}));
  for (const double s : {2.0, 5.0, 9.0, 15.0, 19.0}) {
    EXPECT_NEAR(path.at(s).curvature, back.at(s).curvature, 1e-3) << s;
    EXPECT_NEAR(path.at(s).heading, back.at(s).heading, 1e-4) << s;
  }
  EXPECT_NEAR(path.length(), back.length(), 2e-3);
}

TEST(Conversions, PathThatIsNoneIsEmpty) {
  nav_msgs::Path message = toRos(geometry::buildPath({{2.0, 0.0, 0.0}}, {}, 0.5), Stamp{});
  nav_msgs::Path broken = message;
  broken.poses[1].pose.position.x = kNan;
  EXPECT_TRUE(toCore(broken).empty());
  broken = message;
  broken.poses[1] = broken.poses[0];
  EXPECT_TRUE(toCore(broken).empty());
  broken.poses.resize(1);
  EXPECT_TRUE(toCore(broken).empty());
}

TEST(Conversions, CloudComesBackUnchanged) {
  pcl::PointCloud<pcl::PointXYZ> cloud;
  cloud.push_back({1.0F, 2.0F, 0.0F});
  cloud.push_back({3.0F, -4.0F, 0.0F});
  const auto back = toCore(toRos(cloud, std::chrono::seconds(1)));
  ASSERT_NE(nullptr, back);
  ASSERT_EQ(2u, back->size());
  EXPECT_EQ(-4.0F, back->points[1].y);
}

// Other fields before and between, rows with something behind them.
TEST(Conversions, ACloudOfAnotherLayoutIsRead) {
  sensor_msgs::PointCloud2 message;
  const auto field = [&](const char* name, std::uint8_t type, std::uint32_t offset) {
    message.fields.emplace_back();
    message.fields.back().name = name;
    message.fields.back().datatype = type;
    message.fields.back().offset = offset;
    message.fields.back().count = 1;
  };
  field("ring", sensor_msgs::PointField::UINT16, 0);
  field("z", sensor_msgs::PointField::FLOAT32, 2);
  field("x", sensor_msgs::PointField::FLOAT32, 10);
  field("y", sensor_msgs::PointField::FLOAT32, 6);
  message.width = 2;
  message.height = 2;
  message.point_step = 15;
  message.row_step = 33;
  message.data.resize(66);
  for (std::uint32_t i = 0; i < 4; ++i) {
    std::uint8_t* at = &message.data[i / 2 * 33 + i % 2 * 15];
    const float z = 0.5F, x = 10.0F + static_cast<float>(i), y = -static_cast<float>(i);
    std::memcpy(at + 2, &z, 4);
    std::memcpy(at + 10, &x, 4);
    std::memcpy(at + 6, &y, 4);
  }
  const auto cloud = toCore(message);
  ASSERT_NE(nullptr, cloud);
  ASSERT_EQ(4u, cloud->size());
  EXPECT_EQ(2u, cloud->width);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(10.0F + static_cast<float>(i), cloud->points[i].x);
    EXPECT_EQ(-static_cast<float>(i), cloud->points[i].y);
    EXPECT_EQ(0.5F, cloud->points[i].z);
  }
}

TEST(Conversions, CloudThatAnnouncesMoreThanItHoldsIsRefused) {
  pcl::PointCloud<pcl::PointXYZ> cloud;
  cloud.push_back({1.0F, 2.0F, 0.0F});
  const sensor_msgs::PointCloud2 good = toRos(cloud, std::chrono::seconds(1));
  const auto refused = [&](const std::function<void(sensor_msgs::PointCloud2&)>& spoil) {
    sensor_msgs::PointCloud2 message = good;
    spoil(message);
    return toCore(message) == nullptr;
  };
  EXPECT_FALSE(refused([](auto&) {}));
  EXPECT_TRUE(refused([](auto& m) { m.data.pop_back(); }));
  EXPECT_TRUE(refused([](auto& m) { m.width = 2; }));
  EXPECT_TRUE(refused([](auto& m) { m.width = 1000000; }));
  EXPECT_TRUE(refused([](auto& m) { m.fields.clear(); }));
  EXPECT_TRUE(refused([](auto& m) { m.height = 2; }));
  EXPECT_TRUE(refused([](auto& m) { m.row_step = 1; }));
  EXPECT_TRUE(refused([](auto& m) { m.point_step = 8; }));
  EXPECT_TRUE(refused([](auto& m) { m.fields[1].offset = 0xFFFFFFFEU; }));
  EXPECT_TRUE(refused([](auto& m) { m.fields[1].datatype = sensor_msgs::PointField::FLOAT64; }));
  EXPECT_TRUE(refused([](auto& m) { m.fields[1].name = "w"; }));
  EXPECT_TRUE(refused([](auto& m) { m.is_bigendian = true; }));
}

TEST(Conversions, ACloudOfNoPointsIsEmpty) {
  sensor_msgs::PointCloud2 message = toRos(pcl::PointCloud<pcl::PointXYZ>(), std::chrono::seconds(1));
  message.height = 4'000'000'000U;
  message.width = 0;
  message.row_step = 0;
  const auto cloud = toCore(message);
  ASSERT_NE(nullptr, cloud);
  EXPECT_TRUE(cloud->empty());
}

TEST(Conversions, CommandComesBackUnchanged) {
  supervision::Command command;
  command.stamp = std::chrono::nanoseconds(123456789);
  command.sequence = 42;
  command.articulation_angle = -0.3;
  command.speed = 2.5;
  command.acceleration = 0.7;
  command.stop = true;
  command.mode = supervision::Mode::kAutonomous;
  command.source = supervision::Source::kPreviewDriver;
  command.reason = supervision::Reason::kObstacle;
  const auto back = toCore(toRos(command));
  EXPECT_EQ(command.stamp, back.stamp);
  EXPECT_EQ(command.sequence, back.sequence);
  EXPECT_EQ(command.articulation_angle, back.articulation_angle);
  EXPECT_EQ(command.speed, back.speed);
  EXPECT_EQ(command.acceleration, back.acceleration);
  EXPECT_EQ(command.stop, back.stop);
  EXPECT_EQ(command.mode, back.mode);
  EXPECT_EQ(command.source, back.source);
  EXPECT_EQ(command.reason, back.reason);
}

TEST(ClockWatch, SimulatedTimeThatFlowsIsNoJump) {
  ClockWatch watch;
  EXPECT_FALSE(watch.jumped(ros::Time(0), ros::SteadyTime(1), true));
  EXPECT_FALSE(watch.jumped(ros::Time(500), ros::SteadyTime(2), true));  // time begins
  EXPECT_FALSE(watch.jumped(ros::Time(500.9), ros::SteadyTime(2), true));
  EXPECT_FALSE(watch.jumped(ros::Time(500.9), ros::SteadyTime(90), true));
}

TEST(ClockWatch, SimulatedTimeThatStepsBackJumps) {
  ClockWatch watch;
  watch.jumped(ros::Time(10), ros::SteadyTime(1), true);
  EXPECT_TRUE(watch.jumped(ros::Time(9.99), ros::SteadyTime(1.1), true));
  EXPECT_FALSE(watch.jumped(ros::Time(10.01), ros::SteadyTime(1.2), true));
}

TEST(ClockWatch, SimulatedTimeThatLeapsAheadJumps) {
  ClockWatch watch;
  watch.jumped(ros::Time(10), ros::SteadyTime(1), true);
  EXPECT_TRUE(watch.jumped(ros::Time(11.01), ros::SteadyTime(1.1), true));
}

TEST(ClockWatch, SystemTimeThatLeavesSteadyTimeJumps) {
  ClockWatch watch;
  watch.jumped(ros::Time(1000), ros::SteadyTime(1), false);
  EXPECT_FALSE(watch.jumped(ros::Time(1005.05), ros::SteadyTime(6), false));
  EXPECT_TRUE(watch.jumped(ros::Time(1005.2), ros::SteadyTime(6.01), false));
  EXPECT_TRUE(watch.jumped(ros::Time(1005.05), ros::SteadyTime(6.02), false));
}

geometry_msgs::Transform mounting(double roll, double yaw) {
  geometry_msgs::Transform transform;
  transform.translation.x = 1.6;
  transform.rotation.x = std::sin(0.5 * roll) * std::cos(0.5 * yaw);
  transform.rotation.y = std::sin(0.5 * roll) * std::sin(0.5 * yaw);
  transform.rotation.z = std::cos(0.5 * roll) * std::sin(0.5 * yaw);
  transform.rotation.w = std::cos(0.5 * roll) * std::cos(0.5 * yaw);
  return transform;
}

TEST(SensorMounting, FlatSensorsPoseIsItsYaw) {
  std::string why;
  const auto pose = planarMounting(mounting(0.0, 0.4), why);
  ASSERT_TRUE(pose.has_value());
  EXPECT_NEAR(1.6, pose->x, 1e-12);
  EXPECT_NEAR(0.4, pose->heading, 1e-9);
}

TEST(SensorMounting, UpsideDownSensorIsRefused) {
  std::string why;
  EXPECT_FALSE(planarMounting(mounting(M_PI, 0.0), why).has_value());
  EXPECT_NE(std::string::npos, why.find("upside down"));
}

TEST(SensorMounting, TransformThatIsNoRotationIsRefused) {
  std::string why;
  geometry_msgs::Transform zero;
  EXPECT_FALSE(planarMounting(zero, why).has_value());
  auto broken = mounting(0.0, 0.0);
  broken.translation.y = kNan;
  EXPECT_FALSE(planarMounting(broken, why).has_value());
}

sensor_msgs::JointState jointState(double stamp, double angle) {
  sensor_msgs::JointState message;
  message.header.stamp = ros::Time(stamp);
  message.name = {"wheel", kArticulationJoint};
  message.position = {9.0, angle};
  return message;
}

nav_msgs::Odometry odometry(double stamp, double speed) {
  nav_msgs::Odometry message;
  message.header.stamp = ros::Time(stamp);
  message.pose.pose.orientation.w = 1.0;
  message.twist.twist.linear.x = speed;
  return message;
}

TEST(PublisherWatch, NoticesASecondNodeUntilItIsSilent) {
  PublisherWatch watch;
  EXPECT_EQ(watch.whyRefused("/lidar", ros::SteadyTime(1.0)), "");
  EXPECT_EQ(watch.whyRefused("/lidar", ros::SteadyTime(1.1)), "");
  EXPECT_NE(watch.whyRefused("/rogue", ros::SteadyTime(1.2)), "");
  EXPECT_NE(watch.whyRefused("/lidar", ros::SteadyTime(1.3)), "");
  EXPECT_NE(watch.whyRefused("/lidar", ros::SteadyTime(2.1)), "");
  EXPECT_EQ(watch.whyRefused("/lidar", ros::SteadyTime(2.3)), "");
}

TEST(PublisherWatch, RefusesAnotherNodeThanTheOneThatIsPinned) {
  PublisherWatch watch("/lidar");
  EXPECT_EQ(watch.whyRefused("/rogue", ros::SteadyTime(1.0)),
            "/rogue publishes it, which only /lidar may");
  EXPECT_NE(watch.whyRefused("/lidar", ros::SteadyTime(1.1)), "") << "the other still speaks";
  EXPECT_EQ(watch.whyRefused("/lidar", ros::SteadyTime(2.2)), "");
}

TEST(MotionInput, SaysNothingUntilBothTopicsSpoke) {
  MotionInput input;
  input.setOdometry(odometry(1.0, 2.0));
  EXPECT_FALSE(input.motion().has_value());
  input.setJointState(jointState(1.0, 0.2));
  ASSERT_TRUE(input.motion().has_value());
  EXPECT_EQ(0.2, input.motion()->articulation);
  EXPECT_EQ(2.0, input.motion()->speed);
}

TEST(MotionInput, IsAsOldAsItsOlderPart) {
  MotionInput input;
  input.setOdometry(odometry(5.0, 2.0));
  input.setJointState(jointState(1.0, 0.2));
  EXPECT_EQ(std::chrono::seconds(1), input.motion()->stamp);
}

TEST(MotionInput, MeasuresARateThatIsNotTold) {
  MotionInput input;
  input.setOdometry(odometry(1.0, 2.0));
  input.setJointState(jointState(1.0, 0.20));
  input.setJointState(jointState(1.1, 0.21));
  EXPECT_NEAR(0.1, input.motion()->articulation_rate, 1e-6);
}

TEST(MotionInput, PassesOnNumbersThatAreNoneAndRecovers) {
  MotionInput input;
  input.setOdometry(odometry(1.0, 2.0));
  input.setJointState(jointState(1.0, 0.2));
  input.setOdometry(odometry(2.0, kNan));
  EXPECT_FALSE(drivers::isUsable(*input.motion()));
  input.setOdometry(odometry(3.0, 2.0));
  EXPECT_TRUE(drivers::isUsable(*input.motion()));
  input.setJointState(jointState(3.0, kNan));
  EXPECT_FALSE(drivers::isUsable(*input.motion()));
  input.setJointState(jointState(4.0, 0.3));
  EXPECT_TRUE(drivers::isUsable(*input.motion()));
  EXPECT_EQ(0.3, input.motion()->articulation);
}

TEST(TunnelInput, BringsTogetherWhatHasOneStamp) {
  TunnelInput input;
  perception::TunnelState state;
  state.stamp = Stamp(5);
  input.setState(state);
  EXPECT_FALSE(input.take().has_value());
  input.setCenterline(Stamp(4), {});
  EXPECT_FALSE(input.take().has_value());
  input.setCenterline(Stamp(5), {});
  EXPECT_TRUE(input.take().has_value());
  EXPECT_FALSE(input.take().has_value());  // once
}

TEST(BusTap, CountsBeforeFramesAreReadAndLosesNone) {
  can::MemoryBusHub hub;
  auto sender = hub.connect();
  BusTap tap(hub.connect(), 0x110);
  can::Frame frame;
  frame.id = 0x110;
  sender->send(frame);
  frame.id = 0x111;
  sender->send(frame);
  EXPECT_EQ(1u, tap.count());
  EXPECT_EQ(0x110u, tap.newest().id);
  EXPECT_EQ(0x110u, tap.receive()->id);
  EXPECT_EQ(0x111u, tap.receive()->id);
  EXPECT_FALSE(tap.receive().has_value());
}

constexpr double kNose = 1.6;  // [m]

// A corridor 3 m wide, straight for 10 m behind the front axle and ahead of it, or in a left-hand bend
// of 20 m ahead of it; `free` and `stopping` metres from the nose.
ArbiterState stoppingState(double free, double stopping, bool bend = false) {
  ArbiterState state;
  state.header.stamp = ros::Time(7.0);
  state.free_distance = free;
  state.stopping_distance = stopping;
  for (double s = -10.0; s < 30.5; s += 1.0) {
    const double turned = bend && s > 0.0 ? s / 20.0 : 0.0;
    for (const double left : {1.5, -1.5}) {
      geometry_msgs::Point32 point;
      point.x = static_cast<float>(turned > 0.0 ? (20.0 - left) * std::sin(turned) : s);
      point.y = static_cast<float>(turned > 0.0 ? 20.0 - (20.0 - left) * std::cos(turned) : left);
      (left > 0.0 ? state.corridor_left : state.corridor_right).push_back(point);
    }
  }
  return state;
}

struct Reach {
  double from, to, width;  // along x, along y [m]
};

Reach reachOf(const visualization_msgs::Marker& m) {
  Reach reach{1e9, -1e9, 0.0};
  for (const auto& point : m.points) {
    reach.from = std::min(reach.from, point.x);
    reach.to = std::max(reach.to, point.x);
    reach.width = std::max(reach.width, 2.0 * std::abs(point.y));
  }
  return reach;
}

TEST(StoppingMarkers, ReachFromTheNoseAsFarAsTheArbiterSays) {
  const auto markers = stoppingMarkers(stoppingState(12.25, 5.5), kNose);
  ASSERT_EQ(2u, markers.size());
  EXPECT_EQ("free_distance", markers[0].ns);
  EXPECT_EQ("stopping_distance", markers[1].ns);
  for (const auto& m : markers) {
    EXPECT_EQ(visualization_msgs::Marker::ADD, m.action);
    EXPECT_EQ("base_link", m.header.frame_id);
    EXPECT_EQ(ros::Time(7.0), m.header.stamp);
    EXPECT_EQ(m.points.size(), m.colors.size());
    EXPECT_NEAR(kNose, reachOf(m).from, 1e-5);
    EXPECT_NEAR(3.0, reachOf(m).width, 1e-5);  // the gate's
  }
  EXPECT_NEAR(kNose + 12.25, reachOf(markers[0]).to, 1e-5);
  EXPECT_NEAR(kNose + 5.5, reachOf(markers[1]).to, 1e-5);
}

TEST(StoppingMarkers, FollowTheCorridorsBend) {
  const auto markers = stoppingMarkers(stoppingState(15.0, 5.0, true), kNose);
  const double turned = (kNose + 15.0) / 20.0;
  // The last quad is the gate: its middle is where the free way ends.
  const auto& points = markers[0].points;
  ASSERT_GE(points.size(), 6u);
  const auto& left = points[points.size() - 6];
  const auto& right = points[points.size() - 5];
  EXPECT_NEAR(20.0 * std::sin(turned), 0.5 * (left.x + right.x), 0.1);
  EXPECT_NEAR(20.0 * (1.0 - std::cos(turned)), 0.5 * (left.y + right.y), 0.1);
}

TEST(StoppingMarkers, TellTheMarginByTheirColour) {
  const auto colorAt = [](double margin) {
    return stoppingMarkers(stoppingState(5.0 + margin, 5.0), kNose)[1].color;
  };
  EXPECT_EQ(1.0F, colorAt(0.5).r);  // red
  EXPECT_EQ(0.0F, colorAt(0.5).g);
  EXPECT_EQ(0.0F, colorAt(-4.0).g);
  EXPECT_NEAR(1.0F, colorAt(2.0).r, 1e-5);  // yellow
  EXPECT_NEAR(1.0F, colorAt(2.0).g, 1e-5);
  EXPECT_EQ(0.0F, colorAt(3.5).r);  // green
  EXPECT_EQ(1.0F, colorAt(9.0).g);
}

TEST(StoppingMarkers, EndWithTheCorridorAndAreRemovedWhereNothingIsKnown) {
  EXPECT_NEAR(30.0, reachOf(stoppingMarkers(stoppingState(80.0, 5.0), kNose)[0]).to, 1e-5);
  ArbiterState nowhere = stoppingState(5.0, 5.0);
  nowhere.corridor_left.clear();
  for (const ArbiterState& state : {stoppingState(0.0, 0.0), stoppingState(kNan, kNan), nowhere}) {
    for (const auto& m : stoppingMarkers(state, kNose)) {
      EXPECT_EQ(visualization_msgs::Marker::DELETE, m.action) << m.ns;
      EXPECT_TRUE(m.points.empty());
    }
  }
}

bool tells(const StatusText& status, const std::string& words) {
  return status.text.find(words) != std::string::npos;
}

StatusInput drivingStatus() {
  StatusInput input;
  input.truck.emplace();
  input.truck->state = TruckStatus::STATE_ACTIVE;
  input.truck->reason_text = "driving as asked";
  input.arbiter.emplace();
  input.arbiter->source = TruckCommand::SOURCE_PREVIEW_DRIVER;
  input.arbiter->reason_text = "driving as asked";
  input.arbiter->limited_by = "sight";
  input.arbiter->free_distance = 12.5;
  input.command.emplace();
  input.command->mode = TruckCommand::MODE_AUTONOMOUS;
  input.command->speed = 2.5;
  input.odometry.emplace();
  input.odometry->twist.twist.linear.x = 2.25;
  return input;
}

TEST(StatusText, TellsHowTheTruckDrives) {
  const auto status = describe(drivingStatus());
  EXPECT_EQ(Gravity::kNormal, status.gravity);
  for (const auto* words : {"ACTIVE, autonomous", "driving as asked", "steered by: preview driver",
                            "2.25 m/s of 2.50, limit: sight", "free: 12.5 m"}) {
    EXPECT_TRUE(tells(status, words)) << words << " is not in\n" << status.text;
  }
}

TEST(StatusText, TellsHowSureTheNetworkIs) {
  auto input = drivingStatus();
  EXPECT_FALSE(tells(describe(input), "network"));
  input.network.emplace();
  input.network->valid = true;
  input.network->confidence = 0.87;
  EXPECT_TRUE(tells(describe(input), "network: confidence 0.87"));
  input.network->valid = false;
  EXPECT_TRUE(tells(describe(input), "network: no proposal"));
}

TEST(StatusText, TellsWhyTheBridgeStoppedTheTruck) {
  auto input = drivingStatus();
  input.truck->state = TruckStatus::STATE_STOPPED;
  input.truck->reason_text = "no lidar scan";
  const auto status = describe(input);
  EXPECT_EQ(Gravity::kStopped, status.gravity);
  EXPECT_TRUE(tells(status, "no lidar scan"));
  EXPECT_FALSE(tells(status, "driving as asked"));
}

TEST(StatusText, TellsWhyTheTruckIsNotReady) {
  auto input = drivingStatus();
  input.truck->state = TruckStatus::STATE_STANDBY;
  input.arbiter->stop = true;
  input.arbiter->reason = static_cast<std::uint8_t>(supervision::Reason::kTunnelInvalid);
  input.arbiter->reason_text = "no valid tunnel";
  const auto status = describe(input);
  EXPECT_EQ(Gravity::kStandby, status.gravity);
  EXPECT_TRUE(tells(status, "no valid tunnel"));
}

TEST(StatusText, TellsTheBridgesReasonWhereTheArbiterFindsNothingWrong) {
  auto input = drivingStatus();
  input.truck->state = TruckStatus::STATE_DEGRADED;
  input.truck->reason_text = "the driver's proposal is too old";
  EXPECT_TRUE(tells(describe(input), "the driver's proposal is too old"));
  input.truck->state = TruckStatus::STATE_STANDBY;
  input.truck->reason_text = "the operator took over";
  input.arbiter->reason = static_cast<std::uint8_t>(supervision::Reason::kNotEngaged);
  input.arbiter->reason_text = "not engaged";
  EXPECT_TRUE(tells(describe(input), "the operator took over"));
}

TEST(StatusText, TellsTheBridgesReasonWhileItDoesNotHearTheTruck) {
  auto input = drivingStatus();
  input.truck->state = TruckStatus::STATE_INIT;
  input.truck->reason_text = "no fresh frames from the truck";
  input.arbiter->reason = static_cast<std::uint8_t>(supervision::Reason::kMotionStale);
  input.arbiter->reason_text = "no motion feedback";
  EXPECT_TRUE(tells(describe(input), "no fresh frames from the truck"));
  EXPECT_FALSE(tells(describe(input), "no motion feedback"));
}

TEST(StatusText, TellsWhatTheArbiterFindsNowRatherThanWhyTheBridgeDegradedBefore) {
  auto input = drivingStatus();
  input.truck->state = TruckStatus::STATE_DEGRADED;
  input.truck->reason_text = "no lidar scan";
  input.arbiter->reason = static_cast<std::uint8_t>(supervision::Reason::kLowConfidence);
  input.arbiter->reason_text = "low confidence of the driver";
  EXPECT_TRUE(tells(describe(input), "low confidence of the driver"));
  EXPECT_FALSE(tells(describe(input), "no lidar scan"));
}

TEST(StatusText, TellsOfTheTunnelWhereThereIsNoPilot) {
  StatusInput input;
  input.tunnel.emplace();
  input.tunnel->reason = TunnelState::REASON_NO_WALLS;
  EXPECT_TRUE(tells(describe(input), "no tunnel: "));
  EXPECT_EQ(Gravity::kLimited, describe(input).gravity);
  input.tunnel->valid = true;
  input.tunnel->width = 5.0;
  input.tunnel->curvature = -1.0 / 25.0;
  EXPECT_TRUE(tells(describe(input), "width 5.00 m, radius 25 m right"));
  EXPECT_EQ(Gravity::kNormal, describe(input).gravity);
}

TEST(StatusText, IsEmptyWhereNothingIsKnown) { EXPECT_TRUE(describe({}).text.empty()); }

TEST(StatusLine, TellsInOneLineWhatAnOperatorAsks) {
  auto input = drivingStatus();
  input.network.emplace();
  input.network->valid = true;
  input.network->confidence = 0.87;
  input.network->model = "lidar_driver 0123456789abcdef0123456789abcdef";
  input.tunnel.emplace();
  input.tunnel->valid = true;
  input.tunnel->lateral_offset = 0.04;
  input.tunnel->width = 5.0;
  EXPECT_EQ(
      "ACTIVE, autonomous: driving as asked | preview driver, network lidar_driver 0123456789ab "
      "confidence 0.87 | 2.25 m/s of 2.50, limit: sight | offset +0.04 m, heading +0.0 deg | scan 0.05 "
      "s "
      "old, feedback 0.01 s old",
      statusLine(input, {0.05, 0.01}));
}

TEST(StatusLine, SaysThatNobodyIsHeard) {
  EXPECT_EQ("no pilot is heard | no scan, no feedback", statusLine({}, {}));
}

TEST(StatusLine, ColoursAStopRed) {
  EXPECT_EQ("\033[31mSTOPPED\033[0m", coloured("STOPPED", Gravity::kStopped));
}

TEST(StatusPace, IsDueOnceASecond) {
  StatusPace pace;
  const auto input = drivingStatus();
  EXPECT_TRUE(pace.due(input, 10.0));
  EXPECT_FALSE(pace.due(input, 10.99));
  EXPECT_TRUE(pace.due(input, 11.0));
}

TEST(StatusPace, IsDueAtOnceWhenTheReasonChanges) {
  StatusPace pace;
  auto input = drivingStatus();
  EXPECT_TRUE(pace.due(input, 10.0));
  input.arbiter->reason = static_cast<std::uint8_t>(supervision::Reason::kScanStale);
  input.arbiter->reason_text = "no lidar scan";
  EXPECT_TRUE(pace.due(input, 10.05));
  EXPECT_FALSE(pace.due(input, 10.1));
}

TEST(StatusPace, WaitsASecondBeforeItTellsThatNothingIsKnown) {
  StatusPace pace;
  EXPECT_FALSE(pace.due({}, 10.0));
  EXPECT_TRUE(pace.due({}, 11.0));
}

// A pilot with a bridge and a network that drives as it should.
CheckFacts soundPilot() {
  CheckFacts facts;
  facts.sim_time = true;
  facts.clock_passed = 3.0;
  for (const char* node : {"scan_filter", "wall_segmentation", "centerline", "preview_driver",
                           "lidar_driver", "arbiter", "can_bridge"}) {
    facts.nodes[node] = {true, true};
  }
  for (const char* topic : {"scan", "joint_states", "odom", "command"}) {
    facts.topics[topic] = {{"/somebody"}, 100, 35.0, 0.04};
  }
  facts.model = "lidar_driver 0123456789abcdef";
  facts.truck.emplace();
  facts.truck->state = TruckStatus::STATE_STANDBY;
  facts.truck->reason_text = "not engaged";
  return facts;
}

// The one line that tells what is wrong.
std::string failureOf(const CheckFacts& facts) {
  std::string lines;
  for (const Finding& finding : judge(facts)) {
    if (!finding.ok) lines += finding.line() + "\n";
  }
  return lines;
}

TEST(SelfCheck, FindsNothingWrongWithASoundPilot) {
  EXPECT_EQ("", failureOf(soundPilot()));
  EXPECT_TRUE(allOk(judge(soundPilot())));
}

TEST(SelfCheck, ALineTellsWhatIsWrongAndWhatToDo) {
  EXPECT_EQ("FAIL  scan: nobody publishes it; start the lidar",
            (Finding{false, "scan: nobody publishes it", "start the lidar"}.line()));
  EXPECT_EQ("OK    odom: 50.0 Hz", (Finding{true, "odom: 50.0 Hz", ""}.line()));
}

TEST(SelfCheck, FailsWithoutSimulatedTime) {
  auto facts = soundPilot();
  facts.clock_passed = 0.0;
  EXPECT_NE(std::string::npos, failureOf(facts).find("simulated time stands still"));
}

TEST(SelfCheck, FailsForANodeThatRefusedItsParameters) {
  auto facts = soundPilot();
  facts.nodes["arbiter"] = {true, false};
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  arbiter: has parameters, but gives no sign of life"));
}

TEST(SelfCheck, FailsForANodeThatWasNotStarted) {
  auto facts = soundPilot();
  facts.nodes["centerline"] = {false, false};
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  centerline: is not there"));
}

TEST(SelfCheck, BridgeAndNetworkMayBeLeftOut) {
  auto facts = soundPilot();
  facts.nodes["can_bridge"] = facts.nodes["lidar_driver"] = {false, false};
  facts.model.clear();
  facts.truck.reset();
  facts.arbiter.emplace();
  facts.arbiter->reason_text = "driving as asked";
  EXPECT_EQ("", failureOf(facts));
}

TEST(SelfCheck, FailsWithoutTheLidarsPlace) {
  auto facts = soundPilot();
  facts.mounting_problem = "it is mounted tilted";
  EXPECT_NE(std::string::npos, failureOf(facts).find("base_link -> laser: it is mounted tilted"));
}

TEST(SelfCheck, FailsForASlowTopic) {
  auto facts = soundPilot();
  facts.topics["odom"].rate = 5.0;
  EXPECT_EQ("FAIL  odom: 5.0 Hz from /somebody; at least 10 Hz are needed\n", failureOf(facts));
}

TEST(SelfCheck, FailsForASilentTopicAndForTwoPublishers) {
  auto facts = soundPilot();
  facts.topics["scan"].messages = 0;
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  scan: nothing came from /somebody"));
  facts.topics["scan"].publishers = {"/one", "/two"};
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  scan: several nodes publish it: /one, /two"));
}

TEST(SelfCheck, FailsForStampsOfAnotherClock) {
  auto facts = soundPilot();
  facts.topics["scan"].age = -3600.0;
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  scan: its stamps are 3600.00 s ahead of the clock"));
}

TEST(SelfCheck, FailsForANetworkThatProposesNothing) {
  auto facts = soundPilot();
  facts.model.clear();
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  network: lidar_driver proposes nothing"));
}

TEST(SelfCheck, TellsWhyTheTruckWasStopped) {
  auto facts = soundPilot();
  facts.truck->state = TruckStatus::STATE_STOPPED;
  facts.truck->reason_text = "no lidar scan";
  EXPECT_EQ(0U, failureOf(facts).find("FAIL  truck: STOPPED: no lidar scan; "));
}

TEST(RunInfoText, IsYamlWithParametersNetworksAndTheHashesOfFiles) {
  RunFacts facts;
  facts.time = ros::Time(12.5);
  facts.models = {"lidar_driver 0123"};
  facts.parameters["/arbiter"] = tree("3");
  facts.parameters["/arbiter"]["margin"] = 0.1;
  facts.parameters["/arbiter"]["truck_file"] = TUNNEL_PILOT_SOURCE_DIR "/LICENSE";
  const YAML::Node info = YAML::Load(runInfoText(facts));
  EXPECT_EQ(12.5, info["time"].as<double>());
  EXPECT_EQ("lidar_driver 0123", info["networks"][0].as<std::string>());
  EXPECT_EQ(0.1, info["parameters"]["/arbiter"]["margin"].as<double>());
  EXPECT_EQ("!", info["parameters"]["/arbiter"]["key"].Tag()) << "a text, not a number";
  EXPECT_EQ(64U, info["files"][TUNNEL_PILOT_SOURCE_DIR "/LICENSE"].as<std::string>().size());
}

TEST(OdometryMessage, HasTheCovarianceOfWhatIsMeasured) {
  vehicle::TruckGeometry truck{};
  truck.front_axle_to_hinge = 2.0;
  truck.rear_axle_to_hinge = 3.0;
  bridge::Odometry odometry(truck, 2.0, 0.05, {0.005, 0.01, 0.02, 0.001, 0.001, 0.0, 0.005},
                            {0.02, {1.0, 0.0, 0.0, 1.0, 100.0, 0.04, 0.15, 0.8}});
  for (int i = 0; i <= 100; ++i) odometry.update(0.0, 0.0, 3.0, 0.0, fromSeconds(0.02 * i));
  const auto message = toRos(odometry);
  EXPECT_NEAR(0.06, std::sqrt(message.pose.covariance[0]), 0.002) << "1 % of 6 m";
  EXPECT_GT(message.pose.covariance[7], 0.0);
  EXPECT_GT(message.pose.covariance[35], 0.0);
  EXPECT_EQ(message.pose.covariance[11], message.pose.covariance[31]) << "y and yaw";
  EXPECT_GT(message.pose.covariance[11], 0.0);
  EXPECT_NEAR(0.03, std::sqrt(message.twist.covariance[0]), 0.001) << "1 % of 3 m/s";
  for (const int unknown : {14, 21, 28}) {
    EXPECT_EQ(1e6, message.pose.covariance[unknown]);
    EXPECT_EQ(1e6, message.twist.covariance[unknown]);
  }
}

}  // namespace
}  // namespace tunnel_pilot::shell
