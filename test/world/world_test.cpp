#include "tunnel_pilot/world/world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot::world {
namespace {

using geometry::PathPoint;
using geometry::Point;
using geometry::Pose;

const std::string kWorlds = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/worlds/";

World loadText(const std::string& text) {
  const std::string file = ::testing::TempDir() + "world_under_test.yaml";
  std::ofstream(file) << text;
  World world = loadWorld(file);
  std::filesystem::remove(file);
  return world;
}

// A tunnel file with these lines for its design line, and more keys.
std::string tunnel(const std::string& line, const std::string& more = "", bool closed = false,
                   double sigma = 0.0) {
  return "type: tunnel\nname: t\nseed: 3\nwidth: 5.0\nwall_spacing: 0.5\nstart_at: 0.0\nclosed: " +
         std::string(closed ? "true" : "false") + "\nroughness: {sigma: " + std::to_string(sigma) +
         ", correlation_length: 2.0}\ndesign_line:\n" + line + more;
}

// Distances from the line to the walls, to the left and to the right, at arc length `s`.
std::pair<double, double> wallsAt(const World& world, double s) {
  const PathPoint p = world.design_line.at(s);
  const RayCaster caster(world.walls, {-M_PI / 2.0, M_PI, 2, 100.0});
  std::vector<float> ranges;
  caster.cast({p.x, p.y, p.heading}, ranges);
  return {ranges[1], ranges[0]};
}

// Signed distances of the wall vertices of a straight tunnel from where a smooth wall would be.
std::vector<double> roughnessOf(const WallChain& wall, double half_width) {
  std::vector<double> offsets;
  for (const Point& p : wall) offsets.push_back(std::abs(p.y()) - half_width);
  return offsets;
}

double correlation(const std::vector<double>& x, std::size_t lag) {
  double sum = 0.0, square = 0.0;
  for (std::size_t i = 0; i + lag < x.size(); ++i) {
    sum += x[i] * x[i + lag];
    square += x[i] * x[i];
  }
  return sum / square;
}

TEST(Tunnel, WallsStandHalfTheWidthBesideTheLine) {
  const World world =
      loadText(tunnel("  - straight: {length: 30.0}\n"
                      "  - bend: {radius: 12.0, angle: 1.2, turn: left, transition: 8.0}\n"
                      "  - straight: {length: 30.0}\n"));
  for (double s = 1.0; s < world.design_line.length() - 1.0; s += 0.7) {
    EXPECT_NEAR(wallsAt(world, s).first, 2.5, 0.01) << s;
    EXPECT_NEAR(wallsAt(world, s).second, 2.5, 0.01) << s;
  }
}

TEST(Tunnel, BendTurnsByItsAngleAndClothoidJoinsItsNeighbours) {
  const World world =
      loadText(tunnel("  - bend: {radius: 12.0, angle: 1.2, turn: right, transition: 8.0}\n"));
  EXPECT_NEAR(world.design_line.points().back().heading, -1.2, 1e-9);
  EXPECT_NEAR(world.design_line.at(4.0).curvature, -0.5 / 12.0, 1e-3);
  EXPECT_NEAR(world.design_line.at(8.1).curvature, -1.0 / 12.0, 1e-9);
}

TEST(Tunnel, ReversalRunsFromOneArcsCurvatureToTheOthers) {
  const World world =
      loadText(tunnel("  - arc: {radius: 12.0, angle: 1.0, turn: left}\n"
                      "  - clothoid: {length: 14.0}\n"
                      "  - arc: {radius: 20.0, angle: 1.0, turn: right}\n"));
  EXPECT_NEAR(world.design_line.at(12.0 + 7.0).curvature, 0.5 * (1.0 / 12.0 - 1.0 / 20.0), 1e-4);
}

TEST(Tunnel, RoughnessHasItsDeviationAndCorrelation) {
  const World world = loadText(tunnel("  - straight: {length: 2000.0}\n", "", false, 0.05));
  for (const WallChain& wall : world.walls) {
    const std::vector<double> offsets = roughnessOf(wall, 2.5);
    double square = 0.0;
    for (const double offset : offsets) square += offset * offset;
    EXPECT_NEAR(std::sqrt(square / static_cast<double>(offsets.size())), 0.05, 0.005);
    EXPECT_NEAR(correlation(offsets, 4), std::exp(-1.0), 0.12);  // 2 m apart
    EXPECT_NEAR(correlation(offsets, 20), 0.0, 0.15);
    const double peak = *std::max_element(offsets.begin(), offsets.end());
    EXPECT_TRUE(peak > 0.11 && peak < 0.24) << peak;
  }
}

TEST(Tunnel, TheTwoWallsAreRoughEachInItsOwnWay) {
  const World world = loadText(tunnel("  - straight: {length: 1000.0}\n", "", false, 0.05));
  const std::vector<double> left = roughnessOf(world.walls[0], 2.5);
  const std::vector<double> right = roughnessOf(world.walls[1], 2.5);
  double product = 0.0;
  for (std::size_t i = 0; i < left.size(); ++i) product += left[i] * right[i];
  EXPECT_LT(std::abs(product) / static_cast<double>(left.size()), 0.2 * 0.05 * 0.05);
}

TEST(Tunnel, SeedDecidesTheRoughness) {
  const std::string file = kWorlds + "straight_8m.yaml";
  const World a = loadWorld(file, {5, false});
  const World b = loadWorld(file, {5, false});
  const World c = loadWorld(file, {6, false});
  EXPECT_TRUE(a.walls == b.walls);
  EXPECT_FALSE(a.walls == c.walls);
}

TEST(Tunnel, WideningMovesBothWallsAndTapers) {
  const World world =
      loadText(tunnel("  - straight: {length: 80.0}\n",
                      "widenings:\n  - {from: 20.0, to: 60.0, width: 8.0, taper: 10.0}\n"));
  EXPECT_NEAR(wallsAt(world, 15.0).first, 2.5, 0.01);
  EXPECT_NEAR(wallsAt(world, 25.0).first, 3.25, 0.05);
  EXPECT_NEAR(wallsAt(world, 40.0).first, 4.0, 0.01);
  EXPECT_NEAR(wallsAt(world, 40.0).second, 4.0, 0.01);
  EXPECT_NEAR(wallsAt(world, 65.0).second, 2.5, 0.01);
}

TEST(Tunnel, WidthAlongTheLineKnowsWideningsBothWaysRound) {
  const std::string file = kWorlds + "default_drift.yaml";  // 8 m wide from 264 to 296 m, tapers of 6 m
  const World world = loadWorld(file);
  const World reversed = loadWorld(file, {std::nullopt, true});
  for (const auto& [s, width] : {std::pair(100.0, 5.0), std::pair(267.0, 6.5), std::pair(280.0, 8.0)}) {
    EXPECT_NEAR(world.widthAt(s), width, 0.1) << s;
    EXPECT_NEAR(reversed.widthAt(world.design_line.length() - s), width, 0.1) << s;
  }
}

TEST(Tunnel, OpeningIsOnItsSideAsDeepAndWideAsAsked) {
  const World world =
      loadText(tunnel("  - straight: {length: 80.0}\n",
                      "openings:\n  - {side: right, at: 40.0, width: 5.0, depth: 25.0}\n"));
  EXPECT_NEAR(wallsAt(world, 40.0).second, 27.5, 0.01);
  EXPECT_NEAR(wallsAt(world, 40.0).first, 2.5, 0.01);
  EXPECT_NEAR(wallsAt(world, 37.7).second, 27.5, 0.01);
  EXPECT_NEAR(wallsAt(world, 37.3).second, 2.5, 0.01);
  EXPECT_NEAR(wallsAt(world, 42.7).second, 2.5, 0.01);
}

TEST(Tunnel, ClosedLineSolvesTwoLengthsAndAnAngle) {
  const World world =
      loadText(tunnel("  - straight: {length: 40.0}\n"
                      "  - bend: {radius: 15.0, angle: 1.7, turn: left, transition: 8.0}\n"
                      "  - straight: {length: 30.0}\n"
                      "  - bend: {radius: 12.0, angle: 1.4, turn: left, transition: 8.0}\n"
                      "  - straight: {}\n"
                      "  - bend: {radius: 13.0, angle: 1.5, turn: left, transition: 8.0}\n"
                      "  - straight: {}\n"
                      "  - bend: {radius: 12.0, turn: left, transition: 8.0}\n",
                      "", true));
  EXPECT_TRUE(world.design_line.closed());
  EXPECT_LT(geometry::closureGap(world.design_line), 1e-6);
  EXPECT_NEAR(world.design_line.points().back().heading, 2.0 * M_PI, 1e-9);
}

TEST(Tunnel, ClosedWallsHaveNoSlit) {
  const World world = loadWorld(kWorlds + "default_drift.yaml");
  const RayCaster caster(world.walls, {-M_PI, 2.0 * M_PI / 2000.0, 2000, 200.0});
  std::vector<float> ranges;
  for (double s = 0.0; s < world.design_line.length(); s += 5.0) {
    const PathPoint p = world.design_line.at(s);
    caster.cast({p.x, p.y, p.heading}, ranges);
    EXPECT_LT(*std::max_element(ranges.begin(), ranges.end()), 150.0F) << s;
  }
}

TEST(Tunnel, ReversedLineRunsTheOtherWayRoundBetweenTheSameWalls) {
  const World there = loadWorld(kWorlds + "default_drift.yaml");
  const World back = loadWorld(kWorlds + "default_drift.yaml", {std::nullopt, true});
  EXPECT_TRUE(there.walls == back.walls);
  const PathPoint a = there.design_line.at(60.0);
  const PathPoint b = back.design_line.at(back.design_line.length() - 60.0);
  EXPECT_NEAR(a.x, b.x, 1e-3);
  EXPECT_NEAR(a.y, b.y, 1e-3);
  EXPECT_NEAR(std::cos(a.heading - b.heading), -1.0, 1e-6);
  EXPECT_NEAR(a.curvature, -b.curvature, 1e-6);
  const auto ahead = back.design_line.project(back.start.position());
  EXPECT_NEAR(geometry::wrapAngle(back.start.heading - ahead.heading), 0.0, 1e-6);
}

TEST(DefaultDrift, IsTheOneOfTheSpecification) {
  const World world = loadWorld(kWorlds + "default_drift.yaml");
  EXPECT_DOUBLE_EQ(world.width, 5.0);
  EXPECT_TRUE(world.design_line.closed());
  EXPECT_LT(geometry::closureGap(world.design_line), 0.01);
  double tightest_left = 0.0, tightest_right = 0.0, widest = 0.0, deepest = 0.0;
  for (const PathPoint& p : world.design_line.points()) {
    tightest_left = std::max(tightest_left, p.curvature);
    tightest_right = std::min(tightest_right, p.curvature);
    const auto [left, right] = wallsAt(world, p.s);
    deepest = std::max(deepest, right);
    if (right < 5.0 && left < 5.0) widest = std::max(widest, left + right);
  }
  EXPECT_NEAR(tightest_left, 1.0 / 12.0, 1e-9);
  EXPECT_NEAR(tightest_right, -1.0 / 12.0, 1e-9);
  EXPECT_NEAR(widest, 8.0, 0.35);
  EXPECT_GT(deepest, 20.0);  // down the side drift
}

TEST(DefaultDrift, CurvatureNeverChangesFasterThanATruckCanSteerAtThreeMetresPerSecond) {
  const World world = loadWorld(kWorlds + "default_drift.yaml");
  const std::vector<PathPoint>& line = world.design_line.points();
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const double rate =
        std::abs(line[i + 1].curvature - line[i].curvature) / (line[i + 1].s - line[i].s);
    EXPECT_LE(rate, 2.0 / 12.0 / 13.0 + 1e-9) << line[i].s;
  }
}

TEST(RandomDrift, LayoutsKeepTheirPromises) {
  bool left = false, right = false;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const World world = loadWorld(kWorlds + "random_drift.yaml", {seed, false});
    EXPECT_GE(world.design_line.length(), 200.0);
    EXPECT_FALSE(world.design_line.closed());
    const std::vector<PathPoint>& line = world.design_line.points();
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      EXPECT_LE(std::abs(line[i].curvature), 1.0 / 12.0 + 1e-9);
      left = left || line[i].curvature > 0.04;
      right = right || line[i].curvature < -0.04;
      const double rate =
          std::abs(line[i + 1].curvature - line[i].curvature) / (line[i + 1].s - line[i].s);
      EXPECT_LE(rate, 2.0 / 12.0 / 13.0 + 1e-9);
    }
  }
  EXPECT_TRUE(left && right);
}

// Parts far apart along the line: the middle of one keeps half a width and the rock from any wall's.
TEST(RandomDrift, SeparateDriftsKeepThreeMetresOfRock) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const World world = loadWorld(kWorlds + "random_drift.yaml", {seed, false});
    const std::vector<PathPoint>& line = world.design_line.points();
    for (std::size_t i = 0; i < line.size(); i += 2) {
      for (std::size_t k = 0; k < i; k += 2) {
        if (line[i].s - line[k].s < 40.0) continue;
        ASSERT_GT(std::hypot(line[i].x - line[k].x, line[i].y - line[k].y), 5.0 + 3.0 - 0.5) << seed;
      }
    }
  }
}

TEST(RandomDrift, SeedDecidesTheLayout) {
  const std::string file = kWorlds + "random_drift.yaml";
  EXPECT_TRUE(loadWorld(file, {4, false}).walls == loadWorld(file, {4, false}).walls);
  EXPECT_NE(loadWorld(file, {4, false}).design_line.length(),
            loadWorld(file, {5, false}).design_line.length());
}

TEST(RandomDrift, ReversedStartsAtTheOtherEnd) {
  const World there = loadWorld(kWorlds + "random_drift.yaml", {4, false});
  const World back = loadWorld(kWorlds + "random_drift.yaml", {4, true});
  EXPECT_NEAR(there.design_line.project(back.start.position()).s, there.design_line.length() - 14.0,
              0.01);
}

TEST(ShippedWorlds, AllLoadWithTheirStartInTheClear) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kWorlds)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".yaml" || name.find("_map.yaml") != std::string::npos) continue;
    const World world = loadWorld(entry.path().string());
    const Point p = world.start.position();
    EXPECT_GT(clearance({p, p + Point(0.1, 0.0), p + Point(0.0, 0.1)}, world.walls), 0.5) << name;
    ++count;
  }
  EXPECT_GE(count, 6);
}

TEST(Obstacle, MovesThereAndBackAgain) {
  const Obstacle obstacle{
      "walker", {{0.0, 0.0}, {1.0, 0.0}, {0.0, 1.0}}, {10.0, 5.0, M_PI / 2.0}, 2.0, 6.0};
  EXPECT_NEAR(obstacle.poseAt(0.0).y, 5.0, 1e-12);
  EXPECT_NEAR(obstacle.poseAt(2.0).y, 9.0, 1e-12);
  EXPECT_NEAR(obstacle.poseAt(4.0).y, 9.0, 1e-12);
  EXPECT_NEAR(obstacle.poseAt(6.0).y, 5.0, 1e-12);
  EXPECT_NEAR(obstacle.poseAt(8.0).y, 9.0, 1e-12);
}

TEST(Obstacle, WithoutTravelNeverTurnsBackAndNeverStartsEarly) {
  const Obstacle obstacle{"car", {{0.0, 0.0}, {1.0, 0.0}, {0.0, 1.0}}, {}, 2.0, 0.0};
  EXPECT_NEAR(obstacle.poseAt(100.0).x, 200.0, 1e-9);
  EXPECT_NEAR(obstacle.poseAt(-5.0).x, 0.0, 1e-12);
}

TEST(Obstacle, ChainIsItsClosedOutlineInTheMap) {
  const Obstacle obstacle{
      "box", {{1.0, 0.0}, {0.0, 2.0}, {0.0, 0.0}}, {10.0, 5.0, M_PI / 2.0}, 0.0, 0.0};
  const WallChain chain = obstacle.chainAt(3.0);
  ASSERT_EQ(chain.size(), 4U);
  EXPECT_TRUE(chain.front() == chain.back());
  EXPECT_NEAR(chain[0].x(), 10.0, 1e-12);
  EXPECT_NEAR(chain[0].y(), 6.0, 1e-12);
  EXPECT_NEAR(chain[1].x(), 8.0, 1e-12);
}

TEST(Obstacle, BesideTheLineStandsWhereTheLineSays) {
  const World world =
      loadText(tunnel("  - arc: {radius: 20.0, angle: 1.5, turn: left}\n",
                      "obstacles:\n  - {name: box, outline: [0, 0, 1, 0, 0, 1], speed: 0, "
                      "travel: 0, beside: {s: 15.0, offset: -1.2, heading: 0.3}}\n"));
  ASSERT_EQ(world.obstacles.size(), 1U);
  const auto at = world.design_line.project(world.obstacles[0].start.position());
  EXPECT_NEAR(at.s, 15.0, 0.01);
  EXPECT_NEAR(at.lateral_offset, -1.2, 0.001);
  EXPECT_NEAR(geometry::wrapAngle(world.obstacles[0].start.heading - at.heading), 0.3, 0.01);
}

}  // namespace
}  // namespace tunnel_pilot::world
