#include "tunnel_pilot/geometry/path.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tunnel_pilot::geometry {
namespace {

TEST(Pose, RelativeUndoesCompose) {
  const Pose a{1.0, -2.0, 2.5};
  const Pose b{0.3, 4.0, 1.5};
  const Pose back = a.relative(a.compose(b));
  EXPECT_NEAR(back.x, b.x, 1e-12);
  EXPECT_NEAR(back.y, b.y, 1e-12);
  EXPECT_NEAR(back.heading, b.heading, 1e-12);
}

TEST(Pose, WrapAngleStaysInHalfOpenInterval) {
  EXPECT_DOUBLE_EQ(wrapAngle(M_PI), M_PI);
  EXPECT_DOUBLE_EQ(wrapAngle(-M_PI), M_PI);
  EXPECT_NEAR(wrapAngle(7.0), 7.0 - 2.0 * M_PI, 1e-12);
}

TEST(BuildPath, QuarterCircleEndsWhereTheCircleDoes) {
  const Path path = buildPath({{12.0 * M_PI / 2.0, 1.0 / 12.0, 1.0 / 12.0}}, Pose{}, 0.5);
  EXPECT_NEAR(path.points().back().x, 12.0, 1e-9);
  EXPECT_NEAR(path.points().back().y, 12.0, 1e-9);
  EXPECT_NEAR(path.points().back().heading, M_PI / 2.0, 1e-12);
}

TEST(BuildPath, ClothoidMatchesFresnelIntegrals) {
  // Curvature pi * s: heading pi s^2 / 2, the Fresnel integrals C(1), S(1).
  const Path path = buildPath({{1.0, 0.0, M_PI}}, Pose{}, 0.05);
  EXPECT_NEAR(path.points().back().x, 0.779893400376823, 1e-9);
  EXPECT_NEAR(path.points().back().y, 0.438259147390355, 1e-9);
}

TEST(BuildPath, RefusesPiecesWithoutLength) {
  EXPECT_THROW(buildPath({{0.0, 0.0, 0.0}}, Pose{}, 0.5), std::invalid_argument);
}

TEST(Path, ProjectionLeftIsPositive) {
  const Path path = buildPath({{20.0, 0.0, 0.0}}, Pose{}, 0.5);
  const PathProjection p = path.project({7.25, 0.8});
  EXPECT_NEAR(p.s, 7.25, 1e-12);
  EXPECT_NEAR(p.lateral_offset, 0.8, 1e-12);
}

TEST(Path, ProjectionBeyondOpenEndProlongsTheTangent) {
  const Path path = buildPath({{20.0, 0.0, 0.0}}, Pose{}, 0.5);
  EXPECT_NEAR(path.project({-3.0, -1.0}).s, -3.0, 1e-12);
  EXPECT_NEAR(path.project({23.0, -1.0}).lateral_offset, -1.0, 1e-12);
}

TEST(Path, ClosedPathWrapsAndHintKeepsTheBranch) {
  const Path circle = buildPath({{2.0 * M_PI * 10.0, 0.1, 0.1}}, Pose{}, 0.25, true);
  EXPECT_LT(closureGap(circle), 1e-8);
  const PathProjection p = circle.project({0.5, 0.2}, circle.length() - 0.5, 5.0);
  EXPECT_NEAR(p.s, 0.5, 0.1);
  EXPECT_NEAR(circle.at(circle.length() + 1.0).x, circle.at(1.0).x, 1e-9);
}

TEST(Path, RefusesArcLengthThatDoesNotGrow) {
  EXPECT_THROW(Path({{0, 0, 0, 0, 0}, {0, 1, 0, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(Path({{0, 0, 0, 0, 0}, {1, NAN, 0, 0, 0}}), std::invalid_argument);
}

}  // namespace
}  // namespace tunnel_pilot::geometry
