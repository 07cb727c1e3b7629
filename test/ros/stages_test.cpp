// Each stage as a nodelet, alone: what it does with good input and with bad.
#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/LoadNetwork.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/ScanRejection.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/TunnelState.h>
#include <tunnel_pilot/Walls.h>
#include <visualization_msgs/MarkerArray.h>

#include "../drivers/random_network.h"
#include "../neural/small_network.h"
#include "stage_test.h"
#include "tunnel_pilot/ros/conversions.h"

namespace tunnel_pilot::shell {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kPeriod = 0.03;  // between scans [s]

class ScanFilterTest : public StageTest {
 protected:
  ScanFilterTest()
      : scan_(nh_.advertise<sensor_msgs::LaserScan>("scan", 10)),
        points_(nh_, "points"),
        filtered_(nh_, "scan_filtered"),
        rejected_(nh_, "scan_rejected") {
    EXPECT_TRUE(load("scan_filter", "scan_filter"));
    EXPECT_TRUE(spinUntil(
        [&] { return scan_.getNumSubscribers() > 0 && points_.connected() && filtered_.connected(); }));
  }

  void announceLidar() {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = "base_link";
    transform.header.stamp = ros::Time::now();
    transform.child_frame_id = "laser";
    transform.transform.translation.x = 1.6;
    transform.transform.rotation.w = 1.0;
    broadcaster_.sendTransform(transform);
  }

  // Scans at the present time until one is accepted: the first ones may come before the transform.
  void driveUntilAccepted() {
    announceLidar();
    ASSERT_TRUE(spinUntil([&] {
      if (!points_.messages.empty()) return true;
      send(scan_, tunnelScan(nextTime()));
      ros::WallDuration(0.02).sleep();
      return false;
    }));
  }

  double nextTime() {
    time_ += kPeriod;
    setTime(time_ + 0.04);
    return time_;
  }

  bool accepts(const sensor_msgs::LaserScan& scan) {
    send(scan_, scan);
    return spinUntil([&] { return points_.has(scan.header.stamp); });
  }

  // The bad scan is followed by a good one: when that has come out, the bad one has been dealt with.
  void expectRejected(const sensor_msgs::LaserScan& bad, const std::string& told) {
    points_.messages.clear();
    filtered_.messages.clear();
    rejected_.messages.clear();
    send(scan_, bad);
    ros::WallDuration(0.02).sleep();  // the stage's queue holds one scan
    EXPECT_TRUE(accepts(tunnelScan(nextTime()))) << "a good scan after the bad one";
    EXPECT_EQ(1u, points_.messages.size());
    EXPECT_TRUE(diagnosticsSay("scan_filter", told));
    ASSERT_EQ(1u, rejected_.messages.size());
    EXPECT_NE(std::string::npos, rejected_.messages[0].text.find(told)) << rejected_.messages[0].text;
    EXPECT_EQ(told == "frozen", static_cast<bool>(rejected_.messages[0].frozen));
  }

  double time_ = 1000.0;
  ros::Publisher scan_;
  Listener<sensor_msgs::PointCloud2> points_;
  Listener<sensor_msgs::LaserScan> filtered_;
  Listener<ScanRejection> rejected_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

TEST_F(ScanFilterTest, GivesPointsInBaseLinkWithTheScansStamp) {
  driveUntilAccepted();
  const double stamp = nextTime();
  ASSERT_TRUE(accepts(tunnelScan(stamp)));
  ASSERT_TRUE(spinUntil([&] { return filtered_.has(ros::Time(stamp)); }));
  EXPECT_EQ("base_link", points_.messages.back().header.frame_id);
  EXPECT_EQ(761u, filtered_.messages.back().ranges.size());
  EXPECT_EQ("laser", filtered_.messages.back().header.frame_id);
}

TEST_F(ScanFilterTest, RefusesToWorkWithoutTheSensorsPoseAndSaysSo) {
  auto scan = tunnelScan(nextTime());
  scan.header.frame_id = "unheard_of";
  send(scan_, scan);
  EXPECT_TRUE(diagnosticsSay("scan_filter", "no transform"));
  EXPECT_TRUE(points_.messages.empty());
}

TEST_F(ScanFilterTest, RefusesALidarThatSeesTooLittle) {
  announceLidar();
  EXPECT_TRUE(spinUntil(
      [&] {
        auto scan = tunnelScan(nextTime());
        scan.ranges.resize(500);
        scan.angle_max = scan.angle_min + 499.0F * scan.angle_increment;
        send(scan_, scan);
        return diagnosticsSay("scan_filter", "view does not cover");
      },
      15.0));
  EXPECT_TRUE(points_.messages.empty());
}

TEST_F(ScanFilterTest, RejectsAScanThatComesTwice) {
  driveUntilAccepted();
  const auto scan = tunnelScan(nextTime());
  ASSERT_TRUE(accepts(scan));
  expectRejected(scan, "repeats");
}

TEST_F(ScanFilterTest, RejectsAScanThatComesTooLate) {
  driveUntilAccepted();
  const auto scan = tunnelScan(nextTime());
  time_ += 0.5;
  nextTime();
  expectRejected(scan, "too old");
}

TEST_F(ScanFilterTest, RejectsAScanFromTheFutureThoughItsTimeComesSoon) {
  driveUntilAccepted();
  const double ahead = nextTime() + 0.04 + 0.1;
  send(scan_, tunnelScan(ahead));
  ros::WallDuration(0.02).sleep();  // in which it is judged
  time_ = ahead;
  ASSERT_TRUE(accepts(tunnelScan(nextTime())));
  EXPECT_FALSE(points_.has(ros::Time(ahead)));
}

TEST_F(ScanFilterTest, RejectsAnIdenticalScan) {
  driveUntilAccepted();
  auto scan = tunnelScan(nextTime());
  ASSERT_TRUE(accepts(scan));
  scan.header.stamp = ros::Time(nextTime());
  expectRejected(scan, "frozen");
}

TEST_F(ScanFilterTest, StartsAnewWhenTheClockJumpsBack) {
  driveUntilAccepted();
  time_ -= 100.0;
  auto scan = tunnelScan(nextTime());
  scan.ranges.resize(760);  // another lidar, even: nothing of the time before the jump counts
  scan.angle_max = scan.angle_min + 759.0F * scan.angle_increment;
  EXPECT_TRUE(accepts(scan));
}

struct BadRanges {
  const char* told;
  std::function<void(sensor_msgs::LaserScan&)> spoil;
};

class BadScanTest : public ScanFilterTest, public ::testing::WithParamInterface<BadRanges> {};

TEST_P(BadScanTest, IsRejectedCountedAndTold) {
  driveUntilAccepted();
  auto bad = tunnelScan(nextTime());
  GetParam().spoil(bad);
  expectRejected(bad, GetParam().told);
}

void fill(sensor_msgs::LaserScan& scan, float value) {
  std::fill(scan.ranges.begin(), scan.ranges.end(), value);
}

INSTANTIATE_TEST_SUITE_P(
    All, BadScanTest,
    ::testing::Values(BadRanges{"suit the angles", [](auto& scan) { scan.ranges.resize(300); }},
                      BadRanges{"every range is NaN", [](auto& scan) { fill(scan, kNan); }},
                      BadRanges{"every range is infinite", [](auto& scan) { fill(scan, kInfinity); }},
                      BadRanges{"negative range", [](auto& scan) { scan.ranges[100] = -1.0F; }},
                      BadRanges{"future", [](auto& scan) { scan.header.stamp += ros::Duration(0.5); }},
                      BadRanges{"before the last",
                                [](auto& scan) { scan.header.stamp -= ros::Duration(0.04); }},
                      BadRanges{"no return", [](auto& scan) { fill(scan, 0.01F); }},
                      BadRanges{"geometry differs", [](auto& scan) { scan.range_max = 30.0F; }},
                      BadRanges{"make no sense", [](auto& scan) { scan.angle_increment = kNan; }}));

// Clouds of a straight tunnel 5.0 m wide, as scan_filter makes them.
sensor_msgs::PointCloud2 tunnelCloud(double stamp, bool left = true, bool right = true) {
  pcl::PointCloud<pcl::PointXYZ> cloud;
  for (double x = 25.0; right && x > -1.0; x -= 0.15) {
    cloud.push_back({static_cast<float>(x), -2.5F, 0.0F});
  }
  for (double x = -1.0; left && x < 25.0; x += 0.15)
    cloud.push_back({static_cast<float>(x), 2.5F, 0.0F});
  return toRos(cloud, toCore(ros::Time(stamp)));
}

class WallsTest : public StageTest {
 protected:
  WallsTest() : points_(nh_.advertise<sensor_msgs::PointCloud2>("points", 10)), walls_(nh_, "walls") {
    EXPECT_TRUE(load("wall_segmentation", "wall_segmentation"));
    EXPECT_TRUE(spinUntil([&] { return points_.getNumSubscribers() > 0 && walls_.connected(); }));
  }
  bool answers(const sensor_msgs::PointCloud2& cloud) {
    send(points_, cloud);
    return spinUntil([&] { return walls_.has(cloud.header.stamp); });
  }

  ros::Publisher points_;
  Listener<Walls> walls_;
};

TEST_F(WallsTest, FindsBothWallsOfATunnel) {
  ASSERT_TRUE(answers(tunnelCloud(1000.0)));
  const auto& walls = walls_.messages.back();
  EXPECT_EQ("base_link", walls.header.frame_id);
  ASSERT_TRUE(walls.left.found && walls.right.found);
  EXPECT_NEAR(2.5, walls.left.curve.front().y, 0.05);
  EXPECT_NEAR(-2.5, walls.right.curve.front().y, 0.05);
  EXPECT_GT(walls.left.points.size(), 50u);
}

TEST_F(WallsTest, AnswersAnEmptyCloudWithNoWalls) {
  ASSERT_TRUE(answers(tunnelCloud(1000.0, false, false)));
  EXPECT_FALSE(walls_.messages.back().left.found);
  EXPECT_FALSE(walls_.messages.back().right.found);
}

TEST_F(WallsTest, RefusesACloudInAnotherFrame) {
  auto cloud = tunnelCloud(1000.0);
  cloud.header.frame_id = "laser";
  send(points_, cloud);
  EXPECT_TRUE(diagnosticsSay("wall_segmentation", "cloud refused"));
  EXPECT_TRUE(walls_.messages.empty());
}

TEST_F(WallsTest, RefusesACloudThatAnnouncesMoreThanItHolds) {
  auto cloud = tunnelCloud(1000.0);
  cloud.data.resize(10);
  send(points_, cloud);
  EXPECT_TRUE(diagnosticsSay("wall_segmentation", "cloud refused"));
  ASSERT_TRUE(answers(tunnelCloud(1000.1)));
}

Walls tunnelWalls(double stamp, bool left = true, bool right = true) {
  Walls walls;
  walls.header.stamp = ros::Time(stamp);
  walls.header.frame_id = "base_link";
  walls.enough_returns = true;
  walls.left.found = left;
  walls.right.found = right;
  for (double x = -1.0; x < 22.0; x += 0.5) {
    geometry_msgs::Point32 point;
    point.x = static_cast<float>(x);
    point.y = 2.7F;
    if (left) walls.left.curve.push_back(point);
    point.y = -2.3F;
    if (right) walls.right.curve.push_back(point);
  }
  walls.left.residual = walls.right.residual = 0.02F;
  return walls;
}

class CenterlineTest : public StageTest {
 protected:
  CenterlineTest()
      : walls_(nh_.advertise<Walls>("walls", 10)),
        odometry_(nh_.advertise<nav_msgs::Odometry>("odom", 10)),
        states_(nh_, "tunnel_state"),
        paths_(nh_, "centerline") {
    EXPECT_TRUE(load("centerline", "centerline"));
    EXPECT_TRUE(spinUntil([&] {
      return walls_.getNumSubscribers() > 0 && odometry_.getNumSubscribers() > 0 &&
             states_.connected() && paths_.connected();
    }));
  }
  TunnelState answerTo(const Walls& walls) {
    send(walls_, walls);
    const auto stamp = walls.header.stamp;
    EXPECT_TRUE(spinUntil([&] { return states_.has(stamp) && paths_.has(stamp); }));
    return states_.messages.empty() ? TunnelState() : states_.messages.back();
  }

  ros::Publisher walls_, odometry_;
  Listener<TunnelState> states_;
  Listener<nav_msgs::Path> paths_;
};

TEST_F(CenterlineTest, TellsWhereTheTruckIsInTheTunnel) {
  send(odometry_, odometryAt(1000.0, 0.0));
  const auto state = answerTo(tunnelWalls(1000.0));
  ASSERT_TRUE(state.valid);
  EXPECT_NEAR(-0.2, state.lateral_offset, 0.02);
  EXPECT_NEAR(5.0, state.width, 0.02);
  EXPECT_NEAR(0.0, state.heading_error, 0.01);
  EXPECT_GT(state.covariance[0], 0.0);
  EXPECT_GT(paths_.messages.back().poses.size(), 10u);
}

TEST_F(CenterlineTest, SaysWhyThereIsNoTunnel) {
  const auto state = answerTo(tunnelWalls(1000.0, false, false));
  EXPECT_FALSE(state.valid);
  EXPECT_EQ(TunnelState::REASON_NO_WALLS, state.reason);
  EXPECT_TRUE(paths_.messages.back().poses.empty());
}

TEST_F(CenterlineTest, FollowsOneWallAfterBothWereSeenButNotAcrossAJumpOfTheClock) {
  ASSERT_TRUE(answerTo(tunnelWalls(1000.0)).valid);
  setTime(1000.1);
  ASSERT_TRUE(answerTo(tunnelWalls(1000.1, true, false)).valid);
  setTime(900.0);
  const auto state = answerTo(tunnelWalls(900.0, true, false));
  EXPECT_FALSE(state.valid);
  EXPECT_EQ(TunnelState::REASON_NEVER_PAIRED, state.reason);
}

TEST_F(CenterlineTest, OdometryFromTheFutureHidesNoneThatComesAfterIt) {
  auto future = odometryAt(1e5, 0.0);
  future.pose.pose.position.x = 1e300;
  for (int i = 0; i < 20; ++i) {
    const double stamp = 1000.0 + kPeriod * i;
    setTime(stamp);
    send(odometry_, odometryAt(stamp, 0.0));
    if (i == 3) send(odometry_, future);
    EXPECT_TRUE(answerTo(tunnelWalls(stamp)).valid) << i;
  }
}

TunnelState stateAt(double stamp, bool valid) {
  TunnelState state;
  state.header.stamp = ros::Time(stamp);
  state.valid = valid;
  state.width = 5.0;
  state.lateral_offset = 0.5;
  state.covariance[0] = state.covariance[5] = state.covariance[10] = state.covariance[15] = 1e-4;
  return state;
}

nav_msgs::Path pathAt(double stamp) {
  return toRos(geometry::buildPath({{22.0, 0.0, 0.0}}, {-1.0, -0.5, 0.0}, 0.5),
               toCore(ros::Time(stamp)));
}

class PreviewDriverTest : public StageTest {
 protected:
  PreviewDriverTest()
      : state_(nh_.advertise<TunnelState>("tunnel_state", 10)),
        path_(nh_.advertise<nav_msgs::Path>("centerline", 10)),
        odometry_(nh_.advertise<nav_msgs::Odometry>("odom", 10)),
        joints_(nh_.advertise<sensor_msgs::JointState>("joint_states", 10)),
        proposals_(nh_, "preview_driver/proposal") {
    EXPECT_TRUE(load("preview_driver", "preview_driver"));
    EXPECT_TRUE(spinUntil([&] {
      return state_.getNumSubscribers() > 0 && path_.getNumSubscribers() > 0 &&
             odometry_.getNumSubscribers() > 0 && joints_.getNumSubscribers() > 0 &&
             proposals_.connected();
    }));
  }
  void tellMotion(double stamp) {
    send(joints_, jointStateAt(stamp, 0.0));
    send(odometry_, odometryAt(stamp, 2.0));
  }
  void tellTunnel(double stamp, bool valid) {
    send(path_, pathAt(stamp));
    send(state_, stateAt(stamp, valid));
  }
  bool proposes(double stamp) {
    return spinUntil([&] { return proposals_.has(ros::Time(stamp)); });
  }

  ros::Publisher state_, path_, odometry_, joints_;
  Listener<Proposal> proposals_;
};

TEST_F(PreviewDriverTest, SteersBackToTheCenterline) {
  for (int i = 0; i < 10; ++i) {
    const double stamp = 1000.0 + kPeriod * i;
    setTime(stamp + 0.04);
    tellMotion(stamp + 0.03);
    tellTunnel(stamp, true);
    ASSERT_TRUE(proposes(stamp));
  }
  const auto& proposal = proposals_.messages.back();
  EXPECT_TRUE(proposal.valid);
  EXPECT_LT(proposal.articulation_angle, -0.01);  // it stands half a metre left: right
  EXPECT_TRUE(proposal.has_preview_point);
}

TEST_F(PreviewDriverTest, ProposesNothingValidWithoutATunnel) {
  setTime(1000.04);
  tellMotion(1000.03);
  tellTunnel(1000.0, false);
  ASSERT_TRUE(proposes(1000.0));
  EXPECT_FALSE(proposals_.messages.back().valid);
}

TEST_F(PreviewDriverTest, SaysThatItLacksTheTrucksMotion) {
  setTime(1000.04);
  tellTunnel(1000.0, true);
  EXPECT_TRUE(diagnosticsSay("preview_driver", "no odometry"));
  EXPECT_TRUE(proposals_.messages.empty());
}

TEST_F(PreviewDriverTest, DoesNotPairAStateWithAnotherScansCenterline) {
  setTime(1000.04);
  tellMotion(1000.03);
  send(path_, pathAt(999.97));
  send(state_, stateAt(1000.0, true));
  EXPECT_FALSE(spinUntil([&] { return !proposals_.messages.empty(); }, 0.3));
}

class LidarDriverTest : public StageTest {
 protected:
  LidarDriverTest()
      : scan_(nh_.advertise<sensor_msgs::LaserScan>("scan_filtered", 10)),
        odometry_(nh_.advertise<nav_msgs::Odometry>("odom", 10)),
        joints_(nh_.advertise<sensor_msgs::JointState>("joint_states", 10)),
        status_(nh_.advertise<TruckStatus>("truck_status", 10)),
        proposals_(nh_, "lidar_driver/proposal"),
        network_(save("network.yaml", 1)) {
    nh_.setParam("lidar_driver/network", folder_.file("network.yaml"));
    EXPECT_TRUE(load("lidar_driver", "lidar_driver"));
    EXPECT_TRUE(spinUntil([&] {
      return scan_.getNumSubscribers() > 0 && odometry_.getNumSubscribers() > 0 &&
             joints_.getNumSubscribers() > 0 && status_.getNumSubscribers() > 0 &&
             proposals_.connected();
    }));
  }

  neural::NetworkFile save(const std::string& name, std::uint64_t seed) {
    neural::NetworkFile network = drivers::randomNetwork(seed);
    neural::saveNetwork(folder_.file(name), network);
    return network;
  }
  void tellMotion(double stamp) {
    send(joints_, jointStateAt(stamp, 0.0));
    send(odometry_, odometryAt(stamp, 2.0));
  }
  Proposal answerTo(const sensor_msgs::LaserScan& scan) {
    send(scan_, scan);
    EXPECT_TRUE(spinUntil([&] { return proposals_.has(scan.header.stamp); }));
    return proposals_.messages.empty() ? Proposal() : proposals_.messages.back();
  }
  Proposal proposalAt(double stamp) {
    setTime(stamp + 0.04);
    tellMotion(stamp + 0.03);
    return answerTo(tunnelScan(stamp));
  }
  void tellState(std::uint8_t state) {
    TruckStatus status;
    status.header.stamp = ros::Time::now();
    status.state = state;
    send(status_, status);
  }
  LoadNetwork::Response loadNetwork(const std::string& file) {
    LoadNetwork call;
    call.request.file = file;
    EXPECT_TRUE(ros::service::call("lidar_driver/load_network", call));
    return call.response;
  }

  neural::Folder folder_;
  ros::Publisher scan_, odometry_, joints_, status_;
  Listener<Proposal> proposals_;
  neural::NetworkFile network_;
};

TEST_F(LidarDriverTest, ProposesWithTheScansStampItsOutputsAndTheNetworksName) {
  const auto proposal = proposalAt(1000.0);
  EXPECT_TRUE(proposal.valid);
  EXPECT_EQ(31u, proposal.outputs.size());
  EXPECT_EQ("random " + network_.sha256, proposal.model);
  EXPECT_DOUBLE_EQ(network_.output.first, proposal.outputs_first);
  EXPECT_NEAR(network_.output.spacing, proposal.outputs_spacing, 1e-12);
  EXPECT_TRUE(diagnosticsSay("lidar_driver", "proposing"));
}

TEST_F(LidarDriverTest, ProposesNothingValidFromAScanWithoutReturnsAndSaysSo) {
  setTime(1000.04);
  tellMotion(1000.03);
  auto scan = tunnelScan(1000.0);
  fill(scan, kNan);
  EXPECT_FALSE(answerTo(scan).valid);
  EXPECT_TRUE(diagnosticsSay("lidar_driver", "no return"));
}

TEST_F(LidarDriverTest, SaysThatItLacksTheTrucksMotion) {
  setTime(1000.04);
  send(scan_, tunnelScan(1000.0));
  EXPECT_TRUE(diagnosticsSay("lidar_driver", "no odometry"));
  EXPECT_TRUE(proposals_.messages.empty());
}

TEST_F(LidarDriverTest, DrivesOnAfterTheClockJumpedBack) {
  ASSERT_TRUE(proposalAt(1000.0).valid);
  setTime(900.0);
  tellMotion(900.03);
  setTime(900.04);
  send(scan_, tunnelScan(900.0));
  EXPECT_TRUE(diagnosticsSay("lidar_driver", "no odometry")) << "motion is forgotten";
  EXPECT_TRUE(proposalAt(900.1).valid);
}

TEST_F(LidarDriverTest, TakesAnotherNetworkInStandby) {
  const neural::NetworkFile other = save("other.yaml", 2);
  ASSERT_NE(network_.sha256, other.sha256);
  tellState(TruckStatus::STATE_STANDBY);
  const auto response = loadNetwork(folder_.file("other.yaml"));
  EXPECT_TRUE(response.success);
  EXPECT_EQ("random " + other.sha256, response.message);
  EXPECT_EQ("random " + other.sha256, proposalAt(1000.0).model);
}

TEST_F(LidarDriverTest, KeepsItsNetworkWhileTheTruckIsNotInStandbyOrTheFileIsBad) {
  save("other.yaml", 2);
  for (const auto& [state, file, told] :
       {std::tuple(TruckStatus::STATE_ACTIVE, folder_.file("other.yaml"), "ACTIVE"),
        std::tuple(TruckStatus::STATE_DEGRADED, folder_.file("other.yaml"), "DEGRADED"),
        std::tuple(TruckStatus::STATE_STOPPED, folder_.file("other.yaml"), "STOPPED"),
        std::tuple(TruckStatus::STATE_STANDBY, folder_.file("none.yaml"), "does not exist"),
        std::tuple(TruckStatus::STATE_STANDBY, std::string("other.yaml"), "absolute path")}) {
    tellState(state);
    const auto response = loadNetwork(file);
    EXPECT_FALSE(response.success) << told;
    EXPECT_NE(std::string::npos, response.message.find(told)) << response.message;
  }
  EXPECT_EQ("random " + network_.sha256, proposalAt(1000.0).model);
}

TEST_F(LidarDriverTest, ATruckThatTellsNoStateMustStand) {
  save("other.yaml", 2);
  tellMotion(1000.0);  // at 2 m/s
  EXPECT_FALSE(loadNetwork(folder_.file("other.yaml")).success);
}

class ArbiterTest : public StageTest {
 protected:
  ArbiterTest()
      : points_(nh_.advertise<sensor_msgs::PointCloud2>("points", 10)),
        walls_(nh_.advertise<Walls>("walls", 10)),
        state_(nh_.advertise<TunnelState>("tunnel_state", 10)),
        path_(nh_.advertise<nav_msgs::Path>("centerline", 10)),
        odometry_(nh_.advertise<nav_msgs::Odometry>("odom", 10)),
        joints_(nh_.advertise<sensor_msgs::JointState>("joint_states", 10)),
        status_(nh_.advertise<TruckStatus>("truck_status", 10)),
        proposal_(nh_.advertise<Proposal>("preview_driver/proposal", 10)),
        commands_(nh_, "command"),
        states_(nh_, "arbiter_state") {
    EXPECT_TRUE(load("arbiter", "arbiter"));
    EXPECT_TRUE(spinUntil([&] {
      return proposal_.getNumSubscribers() > 0 && commands_.connected() && states_.connected();
    }));
  }

  // One scan's worth of everything, 40 ms old, and a proposal to drive straight on.
  void tellAll(double stamp, double angle = 0.0) {
    setTime(stamp + 0.04);
    TruckStatus status;
    status.header.stamp = ros::Time(stamp + 0.03);
    status.state = truck_state_;
    send(status_, status);
    send(joints_, jointStateAt(stamp + 0.03, 0.0));
    send(odometry_, odometryAt(stamp + 0.03, 0.0));
    send(points_, tunnelCloud(stamp));
    send(walls_, tunnelWalls(stamp));
    auto state = stateAt(stamp, true);
    state.lateral_offset = -0.2;
    path_.publish(
        toRos(geometry::buildPath({{22.0, 0.0, 0.0}}, {-1.0, 0.2, 0.0}, 0.5), toCore(ros::Time(stamp))));
    send(state_, state);
    Proposal proposal;
    proposal.header.stamp = ros::Time(stamp);
    proposal.valid = true;
    proposal.articulation_angle = angle;
    proposal.speed = 3.0;
    proposal.confidence = 1.0;
    ros::WallDuration(0.01).sleep();  // the queues hold two messages each
    send(proposal_, proposal);
  }

  // Healthy inputs first, then an engaged truck: the other way round is a stop. Ends at 1000.6.
  TruckCommand engageAndDrive() {
    drive(1000.0, 5);
    truck_state_ = TruckStatus::STATE_ACTIVE;
    return drive(1000.15, 15);
  }

  // Drives for `scans` scans and returns the last command.
  TruckCommand drive(double start, int scans, double angle = 0.0) {
    for (int i = 0; i < scans; ++i) {
      const std::size_t before = commands_.messages.size();
      tellAll(start + kPeriod * i, angle);
      EXPECT_TRUE(spinUntil([&] { return commands_.messages.size() > before; }));
    }
    ros::WallDuration(0.02).sleep();
    ros::spinOnce();
    return commands_.messages.empty() ? TruckCommand() : commands_.messages.back();
  }

  std::uint8_t truck_state_ = TruckStatus::STATE_STANDBY;
  ros::Publisher points_, walls_, state_, path_, odometry_, joints_, status_, proposal_;
  Listener<TruckCommand> commands_;
  Listener<ArbiterState> states_;
};

TEST_F(ArbiterTest, DrivesWithHealthyInputs) {
  const auto command = engageAndDrive();
  EXPECT_FALSE(command.stop) << supervision::toString(static_cast<supervision::Reason>(command.reason));
  EXPECT_GT(command.speed, 0.1);
  EXPECT_EQ(TruckCommand::SOURCE_PREVIEW_DRIVER, command.source);
  EXPECT_FALSE(states_.messages.back().corridor_left.empty());
}

TEST_F(ArbiterTest, CommandsAStopOnItsTimerWhenNothingComes) {
  ASSERT_TRUE(spinUntil([&] {
    setTime(ros::Time::now().toSec() + 0.02);
    return commands_.messages.size() >= 5;
  }));
  EXPECT_EQ(0.0, commands_.messages.back().speed);
  EXPECT_NE(0, commands_.messages.back().reason);
  EXPECT_FALSE(states_.messages.back().reason_text.empty());
}

TEST_F(ArbiterTest, StopsWhenTheScansEnd) {
  ASSERT_FALSE(engageAndDrive().stop);
  ASSERT_TRUE(spinUntil([&] {
    setTime(ros::Time::now().toSec() + 0.01);
    return commands_.messages.back().stop;
  }));
  EXPECT_GT(ros::Time::now().toSec(), 1000.7);
  EXPECT_LT(ros::Time::now().toSec(), 1001.1);
}

TEST_F(ArbiterTest, NeverLetsOutWhatIsNotFinite) {
  engageAndDrive();
  commands_.messages.clear();
  drive(1000.6, 10, std::numeric_limits<double>::quiet_NaN());
  ASSERT_FALSE(commands_.messages.empty());
  for (const auto& command : commands_.messages) {
    EXPECT_TRUE(std::isfinite(command.articulation_angle) && std::isfinite(command.speed));
  }
}

TEST_F(ArbiterTest, StopsWhenTheClockJumpsBack) {
  ASSERT_FALSE(engageAndDrive().stop);
  const auto command = drive(900.0, 3);
  EXPECT_TRUE(command.stop);
  EXPECT_EQ(static_cast<int>(supervision::Reason::kClockJump), command.reason);
}

TEST_F(ArbiterTest, MessagesOfTheFutureDoNotHoldUpADecision) {
  ASSERT_FALSE(engageAndDrive().stop);
  for (int i = 0; i < 10; ++i) send(joints_, jointStateAt(1005.0, 0.0));
  const ros::SteadyTime sent = ros::SteadyTime::now();
  tellAll(1000.6);
  ASSERT_TRUE(spinUntil([&] { return commands_.has(ros::Time(1000.6)); }));
  EXPECT_LT((ros::SteadyTime::now() - sent).toSec(),
            0.3);  // waiting for their time would take 0.05 s each
}

TEST_F(ArbiterTest, NumbersNeverDecrease) {
  engageAndDrive();
  drive(900.0, 3);
  ASSERT_GT(commands_.messages.size(), 10u);
  for (std::size_t i = 1; i < commands_.messages.size(); ++i) {
    EXPECT_GE(commands_.messages[i].sequence, commands_.messages[i - 1].sequence);
  }
}

// The arbiter under a client of dynamic_reconfigure's protocol.
class LiveTuningTest : public ArbiterTest {
 protected:
  using Config = dynamic_reconfigure::Config;

  static Config wanted(const std::string& name, double value) {
    Config config;
    config.doubles.resize(1);
    config.doubles.front().name = name;
    config.doubles.front().value = value;
    return config;
  }

  static Config ask(const Config& config) {
    dynamic_reconfigure::Reconfigure call;
    call.request.config = config;
    EXPECT_TRUE(ros::service::call("arbiter/set_parameters", call));
    return call.response.config;
  }

  static double valueIn(const Config& config, const std::string& name) {
    for (const auto& parameter : config.doubles) {
      if (parameter.name == name) return parameter.value;
    }
    return kNan;
  }

  static double maxSpeedAfter(double value) {
    return valueIn(ask(wanted("governor.max_speed", value)), "governor.max_speed");
  }
};

TEST_F(LiveTuningTest, TellsAClientWhatCanBeChangedInWhichRange) {
  std::vector<dynamic_reconfigure::ConfigDescription> heard;
  const ros::Subscriber subscriber = nh_.subscribe<dynamic_reconfigure::ConfigDescription>(
      "arbiter/parameter_descriptions", 1, [&heard](const auto& m) { heard.push_back(*m); });
  ASSERT_TRUE(spinUntil([&] { return !heard.empty(); }));
  ASSERT_FALSE(heard.front().groups.empty());
  EXPECT_EQ(heard.front().dflt.doubles.size(), heard.front().groups.front().parameters.size());
  EXPECT_DOUBLE_EQ(2.0, valueIn(heard.front().max, "envelope.margin"));
  EXPECT_DOUBLE_EQ(0.2, valueIn(heard.front().dflt, "envelope.margin"));
}

TEST_F(LiveTuningTest, LowerMaxSpeedHoldsTheTruckUnderWay) {
  engageAndDrive();
  EXPECT_DOUBLE_EQ(0.5, maxSpeedAfter(0.5));
  drive(1000.6, 3);
  EXPECT_FLOAT_EQ(0.5F, static_cast<float>(states_.messages.back().speed_limit));
}

TEST_F(LiveTuningTest, HigherMaxSpeedIsTakenInStandby) {
  drive(1000.0, 5);
  EXPECT_DOUBLE_EQ(9.0, maxSpeedAfter(9.0));
}

TEST_F(LiveTuningTest, HigherMaxSpeedIsRefusedUnderWayAndTheAnswerHasTheOldOne) {
  engageAndDrive();
  EXPECT_DOUBLE_EQ(7.0, maxSpeedAfter(9.0));
  EXPECT_TRUE(diagnosticsSay("arbiter", "tuning refused"));
}

TEST_F(LiveTuningTest, ValueOfAnotherTypeSpoilsTheWholeRequest) {
  drive(1000.0, 5);
  Config config = wanted("governor.max_speed", 3.0);
  config.ints.resize(1);
  config.ints.front().name = "envelope.margin";
  config.ints.front().value = 1;
  EXPECT_DOUBLE_EQ(7.0, valueIn(ask(config), "governor.max_speed"));
}

TEST_F(LiveTuningTest, EveryAnswerIsToldToAllClients) {
  drive(1000.0, 5);
  std::vector<Config> heard;
  const ros::Subscriber subscriber = nh_.subscribe<Config>(
      "arbiter/parameter_updates", 10, [&heard](const auto& m) { heard.push_back(*m); });
  ASSERT_TRUE(spinUntil([&] { return !heard.empty(); }));
  maxSpeedAfter(6.0);
  EXPECT_TRUE(spinUntil([&] { return valueIn(heard.back(), "governor.max_speed") == 6.0; }));
}

// Farthest point ahead of the marker of this name in the messages so far [m]; NaN without it.
double reachOf(const std::vector<visualization_msgs::MarkerArray>& messages, const std::string& ns) {
  double farthest = std::numeric_limits<double>::quiet_NaN();
  for (const auto& message : messages) {
    for (const auto& m : message.markers) {
      if (m.ns != ns) continue;
      for (const auto& point : m.points) farthest = std::fmax(farthest, point.x);
    }
  }
  return farthest;
}

TEST_F(StageTest, MarkersShowTheStoppingDistanceFromTheTrucksNose) {
  constexpr double kNose = 1.6;  // of the truck file [m]
  const ros::Publisher states = nh_.advertise<ArbiterState>("arbiter_state", 10);
  std::vector<visualization_msgs::MarkerArray> heard;
  const ros::Subscriber subscriber = nh_.subscribe<visualization_msgs::MarkerArray>(
      "markers", 10, [&heard](const auto& m) { heard.push_back(*m); });
  ASSERT_TRUE(load("markers", "markers"));
  ASSERT_TRUE(
      spinUntil([&] { return states.getNumSubscribers() > 0 && subscriber.getNumPublishers() > 0; }));
  ArbiterState state;
  state.header.stamp = ros::Time(1000.0);
  state.free_distance = 20.0;
  state.stopping_distance = 6.0;
  for (int x = -7; x < 31; ++x) {
    geometry_msgs::Point32 edge;
    edge.x = static_cast<float>(x);
    edge.y = 1.5F;
    state.corridor_left.push_back(edge);
    edge.y = -1.5F;
    state.corridor_right.push_back(edge);
  }
  send(states, state);
  EXPECT_TRUE(spinUntil([&] { return reachOf(heard, "stopping_distance") > 0.0; }));
  EXPECT_NEAR(kNose + 6.0, reachOf(heard, "stopping_distance"), 1e-5);
  EXPECT_NEAR(kNose + 20.0, reachOf(heard, "free_distance"), 1e-5);
}

}  // namespace
}  // namespace tunnel_pilot::shell

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "stages_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
