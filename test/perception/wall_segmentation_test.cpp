#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "drive.h"

namespace tunnel_pilot::perception {
namespace {

using geometry::Path;
using geometry::Point;
using geometry::Pose;

const Path kStraight = geometry::buildPath({{80.0, 0.0, 0.0}}, {}, 0.5);

// Largest distance of a curve's samples from the line `offset` left of `line`, all in the map [m].
double worstMiss(const std::vector<Point>& curve, const Pose& base, const Path& line, double offset) {
  double worst = 0.0;
  for (const Point& p : curve) {
    worst = std::max(worst, std::abs(line.project(base.transform(p)).lateral_offset - offset));
  }
  return worst;
}

WallSegmentationParameters parameters() {
  return loadWallSegmentation(config::loadFile(shippedFile("config/wall_segmentation.yaml")));
}

TEST(WallSegmentation, FindsBothWallsOfAStraightDriftWithTheirReturns) {
  TestLidar lidar(smoothWalls(kStraight, 5.0));
  TestChain chain;
  const Pose base{10.0, 0.4, 0.05};
  chain.update(lidar.scan(base), std::nullopt);
  ASSERT_TRUE(chain.walls->left.found && chain.walls->right.found);
  EXPECT_LT(worstMiss(chain.walls->left.curve, base, kStraight, 2.5), 0.12);
  EXPECT_LT(worstMiss(chain.walls->right.curve, base, kStraight, -2.5), 0.12);
  EXPECT_LT(chain.walls->left.residual, 0.03);
  EXPECT_GT(chain.walls->left.indices.size(), 250U);
  EXPECT_TRUE(std::is_sorted(chain.walls->left.indices.begin(), chain.walls->left.indices.end()));
  for (const int i : chain.walls->left.indices) {
    const pcl::PointXYZ& p = chain.filtered->points->points[static_cast<std::size_t>(i)];
    EXPECT_NEAR(base.transform({p.x, p.y}).y(), 2.5, 0.1);
  }
}

TEST(WallSegmentation, CurvesPairUpAndBeginNearTheLidar) {
  TestLidar lidar(smoothWalls(kStraight, 5.0));
  TestChain chain;
  chain.update(lidar.scan({10.0, 0.0, 0.0}), std::nullopt);
  const std::size_t pairs = std::min(chain.walls->left.curve.size(), chain.walls->right.curve.size());
  ASSERT_GT(pairs, 30U);
  EXPECT_NEAR(chain.walls->left.curve.front().x(), 1.6, 1.1);
  for (std::size_t i = 0; i < pairs; ++i) {
    const Point across = chain.walls->left.curve[i] - chain.walls->right.curve[i];
    EXPECT_NEAR(across.x(), 0.0, 0.2) << i;
    EXPECT_NEAR(across.y(), 5.0, 0.1) << i;
  }
}

TEST(WallSegmentation, FollowsABendOfEightMetresRadiusByNinetyDegrees) {
  const double k = 1.0 / 8.0;
  const Path line = geometry::buildPath(
      {{15.0, 0.0, 0.0}, {8.0, 0.0, k}, {6.0, k, k}, {8.0, k, 0.0}, {30.0, 0.0, 0.0}}, {}, 0.25);
  TestLidar lidar(smoothWalls(line, 5.0));
  TestChain chain;
  for (double s = 5.0; s < 34.0; s += 0.1) {
    const geometry::PathPoint p = line.at(s);
    const Pose base{p.x, p.y, p.heading};
    chain.update(lidar.scan(base), std::nullopt);
    ASSERT_TRUE(chain.walls->left.found || chain.walls->right.found) << s;
    if (chain.walls->left.found) {
      EXPECT_LT(worstMiss(chain.walls->left.curve, base, line, 2.5), 0.30) << s;
    }
    if (chain.walls->right.found) {
      EXPECT_LT(worstMiss(chain.walls->right.curve, base, line, -2.5), 0.30) << s;
    }
  }
}

TEST(WallSegmentation, IndicesChooseWhichPointsAreLookedAt) {
  TestLidar lidar(smoothWalls(kStraight, 5.0));
  TestChain chain;
  chain.update(lidar.scan({10.0, 0.0, 0.0}), std::nullopt);
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud = chain.filtered->points;
  const pcl::IndicesPtr left_half(new std::vector<int>);
  for (std::size_t i = 0; i < cloud->size(); ++i) {
    if (cloud->points[i].y > 0.0F) left_half->push_back(static_cast<int>(i));
  }
  WallSegmentation segmentation(parameters());
  segmentation.setInputCloud(cloud);
  segmentation.setIndices(left_half);
  const Walls& walls = segmentation.segment(fromSeconds(1.0));
  EXPECT_TRUE(walls.left.found);
  EXPECT_FALSE(walls.right.found);
  for (const int i : walls.left.indices) EXPECT_GT(cloud->points[static_cast<std::size_t>(i)].y, 0.0F);
}

TEST(WallSegmentation, TheOrderOfThePointsDoesNotMatter) {
  TestLidar lidar(smoothWalls(kStraight, 5.0));
  TestChain chain;
  const Pose base{10.0, 0.4, 0.05};
  chain.update(lidar.scan(base), std::nullopt);
  const pcl::PointCloud<pcl::PointXYZ>::Ptr shuffled(
      new pcl::PointCloud<pcl::PointXYZ>(*chain.filtered->points));
  std::mt19937_64 random(3);
  std::shuffle(shuffled->points.begin(), shuffled->points.end(), random);
  WallSegmentation segmentation(parameters());
  segmentation.setInputCloud(shuffled);
  const Walls& walls = segmentation.segment(fromSeconds(1.0));
  ASSERT_TRUE(walls.left.found && walls.right.found);
  EXPECT_LT(worstMiss(walls.left.curve, base, kStraight, 2.5), 0.12);
  EXPECT_LT(worstMiss(walls.right.curve, base, kStraight, -2.5), 0.12);
}

TEST(WallSegmentation, WithoutACloudOrWithFewPointsThereIsNoWall) {
  WallSegmentation segmentation(parameters());
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (int i = 0; i < 2; ++i) {
    segmentation.setInputCloud(cloud);
    const Walls& walls = segmentation.segment(fromSeconds(1.0));
    EXPECT_FALSE(walls.enough_returns);
    EXPECT_FALSE(walls.left.found || walls.right.found);
    cloud->resize(10);
  }
}

// What stands in the drift or opens beside it must not bend the walls beside the truck.
struct Scenery {
  const char* name;
  std::vector<world::WallChain> walls;
};

class Disturbed : public ::testing::TestWithParam<int> {
 public:
  static Scenery scenery(int which) {
    std::vector<world::WallChain> walls = smoothWalls(kStraight, 5.0);
    const auto openLeft = [&](const world::WallChain& way_round) {
      world::WallChain left = {{0.0, 2.5}};
      left.insert(left.end(), way_round.begin(), way_round.end());
      left.push_back({80.0, 2.5});
      walls[0] = left;
    };
    switch (which) {
      case 0:
        walls.push_back(box({22.0, 2.05, 0.0}, 5.0, 0.8));
        return {"parked vehicle", walls};
      case 1:
        walls.push_back(box({18.0, -1.2, 0.3}, 0.4, 0.4));
        return {"person", walls};
      case 2:
        openLeft({{20.0, 2.5}, {20.0, 4.5}, {26.0, 4.5}, {26.0, 2.5}});
        return {"side bay", walls};
      case 3:
        openLeft({{20.0, 2.5}, {20.0, 30.0}, {25.0, 30.0}, {25.0, 2.5}});
        return {"junction", walls};
      default:
        openLeft({{20.0, 2.5}, {20.0, 30.0}, {25.0, 30.0}, {25.0, 2.5}});
        walls[1] = {{0.0, -2.5}, {20.0, -2.5}, {20.0, -30.0}, {25.0, -30.0}, {25.0, -2.5}, {80.0, -2.5}};
        return {"crossroad", walls};
    }
  }
};

TEST_P(Disturbed, TheCenterlineStaysWhenDrivingPast) {
  const Scenery scene = scenery(GetParam());
  TestLidar lidar(scene.walls);
  TestChain chain;
  int invalid = 0;
  for (double x = 5.0; x < 40.0; x += 0.1) {
    const Pose base{x, 0.2, 0.02};
    const Tunnel& tunnel = chain.update(lidar.scan(base), base);
    if (!tunnel.state.valid) {
      ++invalid;
      continue;
    }
    EXPECT_NEAR(tunnel.state.lateral_offset, 0.2, 0.12) << scene.name << " at " << x;
    EXPECT_NEAR(tunnel.state.heading_error, 0.02, 0.06) << scene.name << " at " << x;
    EXPECT_NEAR(tunnel.state.width, 5.0, 0.25) << scene.name << " at " << x;
  }
  EXPECT_LE(invalid, 3) << scene.name;
}

INSTANTIATE_TEST_SUITE_P(Sceneries, Disturbed, ::testing::Range(0, 5));

// The first scan of all, with nothing known: the back of a bay beside the truck is not the wall.
TEST(WallSegmentation, AFirstScanBesideABayFindsTheWallsThatGoOn) {
  for (const double depth : {1.0, 2.0, 2.5}) {
    for (double x = 18.0; x < 26.0; x += 0.5) {
      std::vector<world::WallChain> walls = smoothWalls(kStraight, 5.0);
      walls[0] = {{0.0, 2.5},          {20.0, 2.5}, {20.0, 2.5 + depth},
                  {26.0, 2.5 + depth}, {26.0, 2.5}, {80.0, 2.5}};
      TestLidar lidar(walls);
      TestChain chain;
      const Tunnel& tunnel = chain.update(lidar.scan({x, 0.2, 0.02}), std::nullopt);
      ASSERT_TRUE(tunnel.state.valid) << "bay of " << depth << " m, at " << x;
      EXPECT_NEAR(tunnel.state.width, 5.0, 0.2) << "bay of " << depth << " m, at " << x;
      EXPECT_NEAR(tunnel.state.lateral_offset, 0.2, 0.2) << "bay of " << depth << " m, at " << x;
    }
  }
}

// Three scans without a wall where a new first guess would go astray: where a return bay begins to
// widen.
TEST(WallSegmentation, ScansThatShowNoWallLeaveTheTunnelKnown) {
  const world::World drift = world::loadWorld(shippedFile("worlds/default_drift.yaml"));
  for (const int returns : {0, 60}) {
    TestLidar lidar(drift.walls);
    TestChain chain;
    Pose base;
    for (double s = 250.0; s < 263.7; s += 0.1) {
      const geometry::PathPoint at = drift.design_line.at(s);
      base = Pose{at.x, at.y, at.heading}.compose({0.0, 0.23, 0.13});
      chain.update(lidar.scan(base), std::nullopt);
    }
    const pcl::PointCloud<pcl::PointXYZ>::Ptr blind(new pcl::PointCloud<pcl::PointXYZ>);
    for (int i = 0; i < returns; ++i) blind->push_back({-15.0F, 0.15F * static_cast<float>(i), 0.0F});
    for (int i = 0; i < 3; ++i) {
      chain.segmentation.setInputCloud(blind);
      const Walls& none = chain.segmentation.segment(lidar.scan(base).stamp);
      EXPECT_FALSE(none.left.found || none.right.found) << returns;
    }
    chain.update(lidar.scan(base), std::nullopt);
    ASSERT_TRUE(chain.walls->left.found && chain.walls->right.found) << returns;
    const Point across = chain.walls->left.curve.front() - chain.walls->right.curve.front();
    EXPECT_NEAR(across.norm(), 5.2, 0.4) << returns;
    EXPECT_NEAR(std::atan2(-across.x(), across.y()), -0.13, 0.1) << returns;
  }
}

// Each scan's tunnel is the next one's first guess. As the truck weaves, that must not creep away from
// it, though each round of offset and heading could move it by their product: walls are seen as far as
// ever.
TEST(WallSegmentation, WallsAreSeenAsFarAsEverHoweverLongTheTruckWeaves) {
  for (const double turn : {1.0, -1.0}) {
    TestLidar lidar(smoothWalls(kStraight, 5.0));
    TestChain chain;
    for (double phase = 0.0; phase < 250.0; phase += 0.1) {
      const Pose base{20.0, 0.3 * turn * std::sin(phase), 0.25 * std::cos(phase)};
      chain.update(lidar.scan(base), std::nullopt);
      ASSERT_TRUE(chain.walls->left.found && chain.walls->right.found) << turn << " " << phase;
      const double sight = chain.walls->left.curve.back().norm();
      ASSERT_GT(sight, 23.0) << turn << " " << phase;
      ASSERT_LT(sight, 39.0) << turn << " " << phase;
    }
  }
}

TEST(WallSegmentation, RandomCloudsNeverThrowNorGiveBadNumbers) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<float> place(-20.0F, 40.0F);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const std::vector<float> odd = {std::numeric_limits<float>::quiet_NaN(),
                                  std::numeric_limits<float>::infinity(), -1e30F, 3e38F, 0.0F};
  WallSegmentation segmentation(parameters());
  for (int round = 0; round < 1500; ++round) {
    const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
    cloud->resize(random() % 900);
    const bool tunnel = share(random) < 0.5;
    for (pcl::PointXYZ& p : cloud->points) {
      p = {place(random), tunnel ? (random() % 2 == 0 ? 2.5F : -2.5F) : place(random), 0.0F};
      if (share(random) < 0.05) p.x = odd[random() % odd.size()];
      if (share(random) < 0.05) p.y = odd[random() % odd.size()];
    }
    segmentation.setInputCloud(cloud);
    const Walls& walls = segmentation.segment(Stamp(round * 28571428L));
    for (const Wall* wall : {&walls.left, &walls.right}) {
      EXPECT_TRUE(std::isfinite(wall->residual));
      EXPECT_TRUE(wall->found || (wall->curve.empty() && wall->indices.empty()));
      for (const Point& p : wall->curve) ASSERT_TRUE(p.allFinite());
      for (const int i : wall->indices) ASSERT_LT(static_cast<std::size_t>(i), cloud->size());
    }
  }
}

TEST(WallSegmentation, ParametersOutOfRangeAreRefusedByName) {
  for (const char* variant : {"", "corridor/"}) {
    EXPECT_NO_THROW(loadWallSegmentation(
        config::loadFile(shippedFile(std::string("config/") + variant + "wall_segmentation.yaml"))));
  }
  YAML::Node yaml = YAML::LoadFile(shippedFile("config/wall_segmentation.yaml"));
  yaml["width_max"] = 2.0;
  try {
    loadWallSegmentation(config::Node(yaml, "test"));
    FAIL() << "width_max below width_min was accepted";
  } catch (const config::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("width_max"), std::string::npos);
  }
}

}  // namespace
}  // namespace tunnel_pilot::perception
