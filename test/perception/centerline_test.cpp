#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "drive.h"

namespace tunnel_pilot::perception {
namespace {

using geometry::Point;
using geometry::Pose;

CenterlineParameters parameters() {
  return loadCenterline(config::loadFile(shippedFile("config/centerline.yaml")));
}

// Walls as they would be measured from `base` in a straight tunnel along the map's x axis.
Walls straightWalls(const Pose& base, Stamp stamp, double width = 5.0, bool left = true,
                    bool right = true) {
  Walls walls;
  walls.stamp = stamp;
  walls.enough_returns = true;
  const auto draw = [&](Wall& wall, double y) {
    wall.found = true;
    wall.residual = 0.04;
    for (double x = 1.5; x <= 18.0; x += 0.5)
      wall.curve.push_back(base.inverseTransform({base.x + x, y}));
  };
  if (left) draw(walls.left, 0.5 * width);
  if (right) draw(walls.right, -0.5 * width);
  return walls;
}

TEST(Centerline, GivesOffsetHeadingAndWidthOfAStraight) {
  CenterlineEstimator estimator(parameters());
  const Pose base{3.0, 0.3, 0.1};
  const Tunnel& tunnel = estimator.update(straightWalls(base, fromSeconds(1.0)), std::nullopt);
  ASSERT_TRUE(tunnel.state.valid) << toString(tunnel.state.reason);
  EXPECT_EQ(tunnel.state.reason, TunnelReason::kNone);
  EXPECT_EQ(tunnel.state.stamp, fromSeconds(1.0));
  EXPECT_NEAR(tunnel.state.lateral_offset, 0.3, 1e-6);
  EXPECT_NEAR(tunnel.state.heading_error, 0.1, 1e-6);
  EXPECT_NEAR(tunnel.state.curvature, 0.0, 1e-6);
  EXPECT_NEAR(tunnel.state.width, 5.0, 1e-6);
}

TEST(Centerline, ThePathBeginsBesideTheReferencePointAndReachesAsFarAsTheWalls) {
  CenterlineEstimator estimator(parameters());
  const Tunnel& tunnel = estimator.update(straightWalls({}, fromSeconds(1.0)), std::nullopt);
  ASSERT_TRUE(tunnel.state.valid);
  EXPECT_LE(tunnel.centerline.points().front().x, 0.0);
  EXPECT_NEAR(tunnel.centerline.points().back().x, 18.0, 0.3);
}

TEST(Centerline, CovarianceIsThatOfItsErrorsAndGrowsWithTheResidual) {
  CenterlineEstimator estimator(parameters());
  Walls walls = straightWalls({}, fromSeconds(1.0));
  const std::array<double, 16> good = estimator.update(walls, std::nullopt).state.covariance;
  walls.stamp = fromSeconds(2.0);
  walls.left.residual = 0.12;
  const std::array<double, 16> poor = estimator.update(walls, std::nullopt).state.covariance;
  const Eigen::Map<const Eigen::Matrix4d> matrix(good.data());
  EXPECT_TRUE(matrix.isApprox(matrix.transpose(), 1e-12));
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(matrix).eigenvalues().minCoeff(), 0.0);
  for (const std::size_t i : {0U, 5U, 10U, 15U}) EXPECT_GT(poor[i], 2.0 * good[i]) << i;
  EXPECT_LT(std::sqrt(good[0]), 0.5);
  EXPECT_LT(std::sqrt(good[5]), 0.3);
}

TEST(Centerline, WithoutWallsItSaysWhy) {
  CenterlineEstimator estimator(parameters());
  Walls walls;
  EXPECT_EQ(estimator.update(walls, std::nullopt).state.reason, TunnelReason::kTooFewPoints);
  walls.enough_returns = true;
  const Tunnel& tunnel = estimator.update(walls, std::nullopt);
  EXPECT_EQ(tunnel.state.reason, TunnelReason::kNoWalls);
  EXPECT_FALSE(tunnel.state.valid);
  EXPECT_TRUE(tunnel.centerline.empty());
}

TEST(Centerline, OneWallThatWasNeverPairedIsNoTunnel) {
  CenterlineEstimator estimator(parameters());
  const Walls walls = straightWalls({}, fromSeconds(1.0), 5.0, true, false);
  EXPECT_EQ(estimator.update(walls, Pose{}).state.reason, TunnelReason::kNeverPaired);
}

TEST(Centerline, OneWallIsFollowedForTwelveMetresAfterBothWereSeen) {
  for (const bool left : {true, false}) {
    CenterlineEstimator estimator(parameters());
    estimator.update(straightWalls({0.0, 0.2, 0.05}, fromSeconds(1.0)), Pose{0.0, 0.2, 0.05});
    for (double x = 0.1; x < 14.0; x += 0.1) {
      const Pose base{x, 0.2, 0.05};
      const Walls walls = straightWalls(base, fromSeconds(1.0 + x), 5.0, left, !left);
      const TunnelState& state = estimator.update(walls, base).state;
      EXPECT_EQ(state.valid, x <= 12.05) << x;
      EXPECT_EQ(state.reason, x <= 12.05 ? TunnelReason::kNone : TunnelReason::kSingleTooLong) << x;
      if (!state.valid) continue;
      EXPECT_NEAR(state.lateral_offset, 0.2, 0.02) << x;
    }
  }
}

TEST(Centerline, WithoutOdometryOneWallIsFollowedForATime) {
  CenterlineEstimator estimator(parameters());
  estimator.update(straightWalls({}, fromSeconds(1.0)), std::nullopt);
  const auto at = [&](double time) {
    return estimator.update(straightWalls({}, fromSeconds(time), 5.0, false, true), std::nullopt)
        .state.reason;
  };
  EXPECT_EQ(at(1.0 + parameters().single_time_max - 0.01), TunnelReason::kNone);
  EXPECT_EQ(at(1.0 + parameters().single_time_max + 0.01), TunnelReason::kSingleTooLong);
}

TEST(Centerline, WidthsThatAreNoTunnelsAreRefused) {
  for (const auto& [width, reason] : {std::pair{3.3, TunnelReason::kWidthImplausible},
                                      {3.5, TunnelReason::kNone},
                                      {8.9, TunnelReason::kNone},
                                      {9.1, TunnelReason::kWidthImplausible}}) {
    CenterlineEstimator estimator(parameters());
    EXPECT_EQ(estimator.update(straightWalls({}, fromSeconds(1.0), width), Pose{}).state.reason, reason)
        << width;
  }
}

// The walls stand back for half a metre: too wide for a tunnel, though not where the measuring begins.
TEST(Centerline, ARememberedWidthBesideTheTruckThatIsNoTunnelsIsRefused) {
  CenterlineEstimator estimator(parameters());
  TunnelState state;
  for (Pose base{}; base.x < 4.75; base.x += 0.25) {
    Walls walls = straightWalls(base, fromSeconds(1.0 + 0.1 * base.x), 8.9);
    for (auto* curve : {&walls.left.curve, &walls.right.curve}) {
      for (Point& p : *curve) {
        if (std::abs(base.x + p.x() - 4.75) < 0.3) p.y() += std::copysign(0.35, p.y());
      }
    }
    state = estimator.update(walls, base).state;
    EXPECT_TRUE(!state.valid || state.width <= parameters().width_max) << state.width;
  }
  EXPECT_EQ(state.reason, TunnelReason::kWidthImplausible) << state.width;
}

TEST(Centerline, AWidthThatWasNotSeenComingIsAFaultUntilItLasts) {
  CenterlineEstimator estimator(parameters());
  estimator.update(straightWalls({}, fromSeconds(1.0)), Pose{});
  int refused = 0;
  for (int i = 1; i < 100; ++i) {
    const Walls walls = straightWalls({}, fromSeconds(1.0 + 0.03 * i), 7.0);
    const TunnelState& state = estimator.update(walls, Pose{}).state;
    if (state.valid) break;
    EXPECT_EQ(state.reason, TunnelReason::kWidthJump);
    ++refused;
  }
  EXPECT_EQ(refused, parameters().jump_scans - 1);
}

TEST(Centerline, WallsThatFitPoorlyAreRefused) {
  CenterlineEstimator estimator(parameters());
  Walls walls = straightWalls({}, fromSeconds(1.0));
  walls.right.residual = parameters().residual_max + 0.01;
  EXPECT_EQ(estimator.update(walls, Pose{}).state.reason, TunnelReason::kPoorFit);
  walls.right.residual = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(estimator.update(walls, Pose{}).state.reason, TunnelReason::kPoorFit);
}

TEST(Centerline, CurvesWithNanAreRefusedNotPassedOn) {
  CenterlineEstimator estimator(parameters());
  Walls walls = straightWalls({}, fromSeconds(1.0));
  walls.left.curve[5].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(estimator.update(walls, Pose{}).state.valid);
  // Nor does the memory keep them.
  EXPECT_TRUE(estimator.update(straightWalls({}, fromSeconds(1.1)), Pose{}).state.valid);
}

TEST(Centerline, OdometryThatIsNotFiniteOrOutOfAllBoundsCountsAsNone) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), -6e66, 1e300, 1.1e6}) {
    for (double Pose::*field : {&Pose::x, &Pose::y, &Pose::heading}) {
      CenterlineEstimator estimator(parameters());
      Pose odom;
      odom.*field = bad;
      const Tunnel& tunnel = estimator.update(straightWalls({0.0, 0.3, 0.1}, fromSeconds(1.0)), odom);
      ASSERT_TRUE(tunnel.state.valid) << bad;
      EXPECT_NEAR(tunnel.state.lateral_offset, 0.3, 1e-9) << bad;
    }
  }
}

TEST(Centerline, AnOdometryJumpDoesNotBendTheCenterline) {
  CenterlineEstimator estimator(parameters());
  for (int i = 0; i < 30; ++i) {
    const Pose base{0.1 * i, 0.0, 0.0};
    estimator.update(straightWalls(base, fromSeconds(0.03 * i)), base);
  }
  const Pose base{3.0, 0.0, 0.0};
  const Tunnel& tunnel = estimator.update(straightWalls(base, fromSeconds(1.0)), Pose{3.0, 4.0, 0.5});
  ASSERT_TRUE(tunnel.state.valid) << toString(tunnel.state.reason);
  EXPECT_NEAR(tunnel.state.lateral_offset, 0.0, 0.02);
  EXPECT_NEAR(tunnel.state.heading_error, 0.0, 0.02);
}

TEST(Centerline, ResetForgetsThatBothWallsWereSeen) {
  CenterlineEstimator estimator(parameters());
  estimator.update(straightWalls({}, fromSeconds(1.0)), Pose{});
  estimator.reset();
  const Walls walls = straightWalls({}, fromSeconds(1.1), 5.0, true, false);
  EXPECT_EQ(estimator.update(walls, Pose{}).state.reason, TunnelReason::kNeverPaired);
}

// --- against the world's truth
// -----------------------------------------------------------------------------------

struct Errors {
  std::vector<double> heading, offset, width, ahead;  // [rad, m, m, m]
  int scans = 0;
  int valid = 0;

  static double quantile(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
  }
};

// A truck that sways along a world's design line, with odometry whose speed is 1 % and whose yaw rate is
// 0.05 degrees/s off.
Errors driveThrough(const std::string& world_file, std::uint64_t seed, bool reversed = false) {
  world::WorldOptions options;
  options.seed = seed;
  options.reversed = reversed;
  const world::World world = world::loadWorld(shippedFile("worlds/" + world_file), options);
  TestLidar lidar(world.walls, seed);
  TestChain chain;
  const geometry::Path& line = world.design_line;
  const double start = line.project(world.start.position()).s;
  const double end = line.closed() ? start + line.length() : line.length() - 8.0;
  Errors errors;
  Pose odometry;
  std::optional<Pose> last;
  for (double s = start; s < end; s += 3.0 / 35.0) {
    const geometry::PathPoint at = line.at(s);
    const double offset = 0.15 * std::sin(s / 7.0);
    const double heading = 0.15 / 7.0 * std::cos(s / 7.0) + 0.02 * std::sin(s / 4.0);
    const Pose base{at.x - offset * std::sin(at.heading), at.y + offset * std::cos(at.heading),
                    at.heading + heading};
    if (last) {
      Pose moved = last->relative(base);
      moved.x *= 1.01;
      moved.heading += 0.05 * M_PI / 180.0 / 35.0;
      odometry = odometry.compose(moved);
    }
    last = base;
    const Tunnel& tunnel = chain.update(lidar.scan(base), odometry);
    ++errors.scans;
    if (!tunnel.state.valid) continue;
    ++errors.valid;
    errors.heading.push_back(std::abs(geometry::wrapAngle(tunnel.state.heading_error - heading)));
    errors.offset.push_back(std::abs(tunnel.state.lateral_offset - offset));
    errors.width.push_back(std::abs(tunnel.state.width - world.width));
    const double beside = tunnel.centerline.project(Point::Zero()).s;
    if (tunnel.centerline.points().back().s < beside + 10.0) continue;
    const geometry::PathPoint ahead = tunnel.centerline.at(beside + 10.0);
    const Point place = base.transform({ahead.x, ahead.y});
    errors.ahead.push_back(std::abs(line.project(place, s + 10.0, 6.0).lateral_offset));
  }
  return errors;
}

void expectAccurate(const Errors& errors, const std::string& where) {
  EXPECT_GE(errors.valid, 0.97 * errors.scans) << where;
  EXPECT_LE(Errors::quantile(errors.heading, 0.5), 1.0 * M_PI / 180.0) << where;
  EXPECT_LE(Errors::quantile(errors.heading, 0.95), 2.5 * M_PI / 180.0) << where;
  EXPECT_LE(Errors::quantile(errors.offset, 0.5), 0.05) << where;
  EXPECT_LE(Errors::quantile(errors.offset, 0.95), 0.12) << where;
  EXPECT_LE(Errors::quantile(errors.width, 0.5), 0.10) << where;
  EXPECT_LE(Errors::quantile(errors.ahead, 0.5), 0.06) << where;
  EXPECT_LE(Errors::quantile(errors.ahead, 0.95), 0.20) << where;
}

TEST(CenterlineInWorlds, TightBends) {
  for (std::uint64_t seed = 21; seed < 25; ++seed) {
    expectAccurate(driveThrough("tight_bends.yaml", seed), "seed " + std::to_string(seed));
  }
}

TEST(CenterlineInWorlds, TheDefaultDriftBothWaysWithItsReturnBayJunctionAndRefuge) {
  expectAccurate(driveThrough("default_drift.yaml", 31), "forward");
  expectAccurate(driveThrough("default_drift.yaml", 31, true), "backward");
}

TEST(CenterlineInWorlds, RandomDriftsWithBays) {
  for (std::uint64_t seed = 41; seed < 45; ++seed) {
    expectAccurate(driveThrough("random_drift.yaml", seed), "seed " + std::to_string(seed));
  }
}

TEST(CenterlineInWorlds, DustOfAFifthOfTheBeamsChangesLittle) {
  const geometry::Path line = geometry::buildPath({{60.0, 0.0, 0.0}}, {}, 0.5);
  TestLidar lidar(smoothWalls(line, 5.0));
  lidar.lost = 0.2;
  TestChain chain;
  for (double x = 3.0; x < 20.0; x += 0.1) {
    const Tunnel& tunnel = chain.update(lidar.scan({x, 0.2, 0.02}), Pose{x, 0.2, 0.02});
    ASSERT_TRUE(tunnel.state.valid);
    EXPECT_NEAR(tunnel.state.lateral_offset, 0.2, 0.05);
    EXPECT_NEAR(tunnel.state.heading_error, 0.02, 0.03);
  }
}

TEST(CenterlineInWorlds, ASectorWithoutReturnsLeavesTheOtherWall) {
  const geometry::Path line = geometry::buildPath({{60.0, 0.0, 0.0}}, {}, 0.5);
  TestLidar lidar(smoothWalls(line, 5.0));
  TestChain chain;
  for (double x = 3.0; x < 20.0; x += 0.1) {
    const Pose base{x, 0.2, 0.02};
    geometry::Scan scan = lidar.scan(base);
    if (x > 8.0 && x < 16.0) {
      std::fill(scan.ranges.begin() + 400, scan.ranges.end(), std::numeric_limits<float>::quiet_NaN());
    }
    const Tunnel& tunnel = chain.update(scan, base);
    ASSERT_TRUE(tunnel.state.valid) << x << " " << toString(tunnel.state.reason);
    EXPECT_NEAR(tunnel.state.lateral_offset, 0.2, 0.08) << x;
  }
}

TEST(CenterlineInWorlds, ACircularRoomIsNoTunnel) {
  world::WallChain room;
  for (int i = 0; i <= 90; ++i) {
    room.emplace_back(6.5 * std::cos(i * M_PI / 45.0), 6.5 * std::sin(i * M_PI / 45.0));
  }
  TestLidar lidar({room});
  TestChain chain;
  for (int i = 0; i < 20; ++i) {
    EXPECT_FALSE(chain.update(lidar.scan({-1.0, 0.3, 0.1}), std::nullopt).state.valid);
  }
}

}  // namespace
}  // namespace tunnel_pilot::perception
