#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot::world {
namespace {

using geometry::Point;

const std::vector<Point> kSquare = {{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}};

TEST(Clearance, IsTheGapToTheNearestWall) {
  const std::vector<WallChain> walls = {{{-9.0, 3.0}, {9.0, 3.0}}, {{-9.0, -1.5}, {9.0, -1.5}}};
  EXPECT_NEAR(clearance(kSquare, walls), 0.5, 1e-12);
}

TEST(Clearance, CornerAgainstWallEndIsTheirDistance) {
  EXPECT_NEAR(clearance(kSquare, {{{4.0, 5.0}, {9.0, 9.0}}}), 5.0, 1e-12);
}

TEST(Clearance, IsZeroWhereTheyCross) {
  EXPECT_EQ(clearance(kSquare, {{{0.0, -5.0}, {0.3, 5.0}}}), 0.0);
  EXPECT_EQ(clearance(kSquare, {{{0.5, 0.5}, {9.0, 0.0}}}), 0.0);
}

TEST(Clearance, IsZeroWithAnObstacleWhollyInside) {
  EXPECT_EQ(clearance(kSquare, {{{0.1, 0.1}, {0.2, 0.1}, {0.2, 0.2}, {0.1, 0.1}}}), 0.0);
}

TEST(Clearance, WithoutWallsIsInfinite) {
  EXPECT_EQ(clearance(kSquare, {}), std::numeric_limits<double>::infinity());
}

// The shortcut over far segments must never change the answer: points along both outlines, all pairs.
TEST(Clearance, AgreesWithDenseSampling) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> place(-12.0, 12.0);
  for (int k = 0; k < 50; ++k) {
    WallChain chain;
    for (int i = 0; i < 6; ++i) chain.emplace_back(place(engine), place(engine));
    double sampled = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
      for (int a = 0; a <= 300; ++a) {
        const Point p = chain[i] + a / 300.0 * (chain[i + 1] - chain[i]);
        const double dx = std::max(std::abs(p.x()) - 1.0, 0.0);
        const double dy = std::max(std::abs(p.y()) - 1.0, 0.0);
        sampled = std::min(sampled, std::hypot(dx, dy));
      }
    }
    EXPECT_NEAR(clearance(kSquare, {chain}), sampled, 0.06);
  }
}

}  // namespace
}  // namespace tunnel_pilot::world
