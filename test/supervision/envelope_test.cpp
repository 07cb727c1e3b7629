#include "tunnel_pilot/supervision/envelope.h"

#include <gtest/gtest.h>

#include "drift_scene.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::supervision {
namespace {

const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";
constexpr double kHalfTruck = 1.525;  // [m]

// One scan of a scene, the truck where the scan saw it.
struct Check {
  vehicle::TruckGeometry truck = vehicle::loadTruck(kConfig + "truck.yaml").geometry;
  ArbiterParameters parameters = loadArbiter(config::loadFile(kConfig + "arbiter.yaml"));
  Envelope envelope{parameters.envelope, parameters.limiter, truck};
  double speed = 3.0;
  double articulation = 0.0;
  double commanded = 0.0;
  drivers::YawResponse response;
  double slip_compliance = 0.0;
  geometry::Pose odom;

  const Envelope::Result& of(const Scene& scene) {
    drivers::ArticulationProfile profile;
    profile.build(scene.tunnel.centerline, truck, 0.5);
    std::vector<geometry::Point> points;
    for (const TestPoint& p : scene.points) points.emplace_back(p.x, p.y);
    return envelope.update({scene.walls,
                            points,
                            scene.tunnel.centerline,
                            profile,
                            {},
                            {},
                            odom,
                            articulation,
                            commanded,
                            speed,
                            response,
                            slip_compliance});
  }
};

geometry::Path straight() { return geometry::buildPath({{80.0, 0.0, 0.0}}, {}, 0.5); }

Scene straightScene(double offset, double heading = 0.0, double width = 5.0) {
  return sceneAt(straight(), {20.0, offset, heading}, width, Stamp(1));
}

TEST(Envelope, ClearanceInAStraightIsHalfTheDifferenceOfWidths) {
  Check check;
  const Envelope::Result& result = check.of(straightScene(0.0));
  EXPECT_NEAR(result.clearance_left, 2.5 - kHalfTruck, 0.01);
  EXPECT_NEAR(result.clearance_right, 2.5 - kHalfTruck, 0.01);
}

TEST(Envelope, AnEccentricTruckIsNearerToItsWall) {
  Check check;
  const Envelope::Result& result = check.of(straightScene(0.3));
  EXPECT_NEAR(result.clearance_left, 2.5 - 0.3 - kHalfTruck, 0.06);
}

TEST(Envelope, SightEndsTheFreeDistance) {
  Check check;
  const Envelope::Result& result = check.of(straightScene(0.0));
  EXPECT_EQ(result.free_until, Envelope::End::kSight);
  EXPECT_NEAR(result.free_distance, 15.0 - check.truck.front_overhang, 0.01);
}

TEST(Envelope, SightEndsWithTheCenterlineThoughTheWallsGoOn) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.tunnel.centerline = sceneAt(straight(), {20.0, 0.0, 0.0}, 5.0, Stamp(1), 10.0).tunnel.centerline;
  EXPECT_NEAR(check.of(scene).free_distance, 10.0 - check.truck.front_overhang, 0.01);
}

TEST(Envelope, WithoutWallsAndCenterlineNothingIsFree) {
  Check check;
  Scene scene;
  EXPECT_EQ(check.of(scene).free_distance, 0.0);
  EXPECT_TRUE(std::isnan(check.envelope.result().clearance_left));
}

TEST(Envelope, BothBodiesSweepInsideAndOutsideInABend) {
  // Steady on R 12 m the specification's geometry sweeps -1.77...+1.62 m about the front axle's way.
  Check check;
  const double k = 1.0 / 12.0;
  check.articulation = check.commanded = 0.4344;  // steady for R 12 m
  const geometry::Path bend = geometry::buildPath({{70.0, k, k}}, {}, 0.25);
  const geometry::PathPoint p = bend.at(20.0);
  const Envelope::Result& result = check.of(sceneAt(bend, {p.x, p.y, p.heading}, 5.0, Stamp(1)));
  EXPECT_NEAR(result.clearance_left, 2.5 - 1.77, 0.06);
  EXPECT_NEAR(result.clearance_right, 2.5 - 1.62, 0.06);
}

TEST(Envelope, ATooNarrowPlaceEndsTheFreeDistanceAtTheWall) {
  Check check;
  Scene scene = straightScene(0.0);
  for (auto& p : scene.walls.left.curve) {
    if (p.x() > 9.0) p.y() -= 0.9;
  }
  const Envelope::Result& result = check.of(scene);
  EXPECT_EQ(result.free_until, Envelope::End::kWall);
  EXPECT_NEAR(result.free_distance, 9.0 - check.truck.front_overhang, 1.0);
}

TEST(Envelope, ATooNarrowPlaceOnTheRightCountsAlike) {
  Check check;
  Scene scene = straightScene(0.0);
  for (auto& p : scene.walls.right.curve) {
    if (p.x() > 9.0) p.y() += 0.9;
  }
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kWall);
}

TEST(Envelope, TheSmallestObstacleIsFoundAnywhereInTheCorridor) {
  for (const double x : {4.0, 7.0, 11.0}) {
    for (const double y : {-1.4, 0.0, 1.4}) {
      Check check;
      Scene scene = straightScene(0.0);
      addObstacle(scene, x, y, check.parameters.envelope.smallest_obstacle);
      const Envelope::Result& result = check.of(scene);
      EXPECT_EQ(result.free_until, Envelope::End::kObstacle) << x << " " << y;
      EXPECT_NEAR(result.free_distance, x - check.truck.front_overhang, 0.05);
    }
  }
}

TEST(Envelope, AnObstacleBesideTheCorridorIsNone) {
  Check check;
  Scene scene = straightScene(0.0);
  addObstacle(scene, 7.0, 2.15, 0.4);
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kSight);
}

TEST(Envelope, WhatStandsBehindTheTailIsNoObstacle) {
  Check check;
  // A tail of whole metres: the last station stands there, with edges that would go on behind it.
  check.truck.rear_overhang = 7.0 - check.truck.front_axle_to_hinge - check.truck.rear_axle_to_hinge;
  check.envelope = Envelope(check.parameters.envelope, check.parameters.limiter, check.truck);
  Scene scene = straightScene(0.0);
  addObstacle(scene, -6.5, 0.0, 0.8);
  ASSERT_EQ(check.of(scene).free_until, Envelope::End::kObstacle) << "beside the tail it is one";
  scene = straightScene(0.0);
  addObstacle(scene, -7.5, 0.0, 0.8);
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kSight);
}

TEST(Envelope, AnObstacleWithinTheMarginCounts) {
  Check check;
  Scene scene = straightScene(0.0);
  addObstacle(scene, 7.0, kHalfTruck + 0.1, 0.1);
  scene.points.push_back({7.1, kHalfTruck + 0.1});
  scene.points.push_back({7.2, kHalfTruck + 0.1});
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kObstacle);
}

TEST(Envelope, ARoughWallWithinTheMarginIsNoObstacle) {
  Check check;
  Scene scene = straightScene(0.0);
  const double margin = check.parameters.envelope.margin;
  for (auto& p : scene.walls.left.curve) p.y() = kHalfTruck + margin + 0.03;
  for (const double x : {7.0, 7.15, 7.3}) scene.points.push_back({x, kHalfTruck + margin - 0.03});
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kWall);
}

TEST(Envelope, AnObstacleThatTouchesTheRoughWallIsOne) {
  Check check;
  Scene scene = straightScene(0.0);
  const double margin = check.parameters.envelope.margin;
  for (auto& p : scene.walls.left.curve) p.y() = kHalfTruck + margin + 0.03;
  for (const double y : {1.3, 1.45, 1.6}) scene.points.push_back({7.0, y});
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kObstacle);
}

TEST(Envelope, AReturnThatStandsOffTheWallByItsRoughnessIsNotTheWalls) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.tunnel.centerline = geometry::Path();  // the stations stand at whole metres
  const double wall = kHalfTruck + check.parameters.envelope.margin + 0.03;
  for (auto& p : scene.walls.left.curve) p.y() = wall;
  scene.points = {{7.0, wall - 0.20}, {7.1, 1.65}, {7.2, 1.65}};
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kObstacle);
}

TEST(Envelope, ReturnsThatStandApartByTheSmallestObstacleAreNotOne) {
  Check check;
  check.parameters.envelope.smallest_obstacle = 0.5;
  check.envelope = Envelope(check.parameters.envelope, check.parameters.limiter, check.truck);
  Scene scene = straightScene(0.0);
  for (const double y : {-0.5, 0.0, 0.5}) scene.points.push_back({7.0, y});
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kSight);
}

TEST(Envelope, DustBeforeAnObstacleDoesNotBringItNearer) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.points.push_back({4.0, 0.0});
  addObstacle(scene, 9.0, 0.0, 0.8);
  EXPECT_NEAR(check.of(scene).free_distance, 9.0 - check.truck.front_overhang, 0.05);
}

// Where the way ends that a truck takes with a held articulation, left of where it points to [m].
double endOfHeldWay(Check& check) {
  Scene scene;
  check.articulation = check.commanded = 0.1;
  const Envelope::Result& result = check.of(scene);
  return 0.5 * (result.corridor_left.back().y() + result.corridor_right.back().y());
}

TEST(Envelope, ATruckThatTurnsLessThanItsHingeIsExpectedToGoWider) {
  Check check;
  const double usual = endOfHeldWay(check);
  check.response.gain = 0.8;
  EXPECT_LT(endOfHeldWay(check), usual - 0.3);
}

TEST(Envelope, ATruckThatSlipsIsExpectedToGoWider) {
  Check check;
  const double usual = endOfHeldWay(check);
  check.slip_compliance = 0.2;
  EXPECT_LT(endOfHeldWay(check), usual - 0.1);
}

TEST(Envelope, TheExpectedWayTakesABendAtTheSpeedOfAStop) {
  // At 7 m/s the hinge could not follow the bend ahead; nobody will come to it at that speed.
  const geometry::Path line =
      geometry::buildPath({{45.0, 0.0, 0.0}, {10.0, 0.0, 0.0667}, {30.0, 0.0667, 0.0667}}, {}, 0.25);
  Check check;
  check.speed = 7.0;
  const Envelope::Result& result = check.of(sceneAt(line, {20.0, 0.0, 0.0}, 5.0, Stamp(1), 38.0));
  EXPECT_EQ(result.free_until, Envelope::End::kSight);
  EXPECT_GT(result.clearance_right, 0.5);
}

TEST(Envelope, LoneDustDoesNotStopTheTruck) {
  Check check;
  Scene scene = straightScene(0.0);
  for (int i = 0; i < 12; ++i) scene.points.push_back({3.0 + i, i % 2 == 0 ? 1.0 : -1.0});
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kSight);
}

TEST(Envelope, ReturnsThatAreNoNumbersAreNoObstacles) {
  Check check;
  Scene scene = straightScene(0.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 20; ++i) scene.points.push_back({nan, nan});
  EXPECT_EQ(check.of(scene).free_until, Envelope::End::kSight);
}

TEST(Envelope, ACommandIntoTheWallIsSeenBeforeItHappens) {
  Check check;
  check.commanded = 0.6;
  check.speed = 5.0;
  const double away = check.of(straightScene(0.0)).clearance_left;
  check.commanded = 0.0;
  EXPECT_LT(away, check.of(straightScene(0.0)).clearance_left - 0.3);
}

// The left wall comes nearer beside the rear body, where the lidar at the nose no longer looks.
void passANarrowPlace(Check& check) {
  for (double x = 0.0; x <= 8.0; x += 0.25) {
    check.odom = {x, 0.0, 0.0};
    Scene scene = straightScene(0.0);
    for (auto& p : scene.walls.left.curve) {
      if (x + p.x() > 4.0 && x + p.x() < 6.0) p.y() -= 0.5;
    }
    check.of(scene);
  }
}

TEST(Envelope, RemembersTheWallsBesideTheTruck) {
  Check check;
  passANarrowPlace(check);
  EXPECT_NEAR(check.envelope.result().clearance_left, 2.5 - 0.5 - kHalfTruck, 0.05);
  check.envelope.reset();
  EXPECT_NEAR(check.of(straightScene(0.0)).clearance_left, 2.5 - kHalfTruck, 0.01);
}

TEST(Envelope, ATruckThatStandsForLongRemembersTheWallsBesideIt) {
  Check check;
  passANarrowPlace(check);
  for (int scan = 0; scan < 1000; ++scan) check.of(straightScene(0.0));
  EXPECT_NEAR(check.envelope.result().clearance_left, 2.5 - 0.5 - kHalfTruck, 0.05);
}

TEST(Envelope, AfterAResetNothingOfTheWallsIsRemembered) {
  Check check;
  Scene scene = straightScene(0.0);
  for (auto& p : scene.walls.left.curve) p.y() = 1.6;
  check.of(scene);
  check.envelope.reset();
  check.odom.x = 0.5;
  EXPECT_NEAR(check.of(straightScene(0.0)).clearance_left, 2.5 - kHalfTruck, 0.01);
}

TEST(Envelope, AWallThatWasNotFoundIsNotRemembered) {
  Check check;
  for (double x = 0.0; x <= 3.0; x += 0.6) {
    check.odom = {x, 0.0, 0.0};
    Scene scene = straightScene(0.0);
    scene.walls.left.found = false;
    check.of(scene);
  }
  EXPECT_TRUE(std::isnan(check.envelope.result().clearance_left));
}

TEST(Envelope, AGapInAWallIsNotBridged) {
  Check check;
  Scene scene = straightScene(0.0);
  std::vector<geometry::Point> curve;
  for (geometry::Point p : scene.walls.left.curve) {
    if (p.x() > 5.0 && p.x() < 11.0) continue;
    if (p.x() >= 11.0) p.y() -= 1.2;  // 1.3 m: in the way of the truck
    curve.push_back(p);
  }
  scene.walls.left.curve = curve;
  const Envelope::Result& result = check.of(scene);
  EXPECT_EQ(result.free_until, Envelope::End::kWall);
  EXPECT_NEAR(result.free_distance, 11.0 - check.truck.front_overhang, 1.0);
}

TEST(Envelope, AWallThatStepsAsideCountsWithItsNearestPoint) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.tunnel.centerline = geometry::Path();  // the stations stand at whole metres
  std::vector<geometry::Point> curve;
  for (int x = 0; x <= 10; ++x) {
    if (x == 5) curve.emplace_back(5.0, 1.6);
    curve.emplace_back(x, 2.5);
  }
  scene.walls.left.curve = curve;
  EXPECT_NEAR(check.of(scene).clearance_left, 1.6 - kHalfTruck, 1e-6);
}

TEST(Envelope, AWallOfTwoPointsBesideEachOtherCounts) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.tunnel.centerline = geometry::Path();  // the stations stand at whole metres
  scene.walls.left.curve = {{5.0, 1.6}, {5.0, 2.5}};
  EXPECT_NEAR(check.of(scene).clearance_left, 1.6 - kHalfTruck, 1e-6);
}

TEST(Envelope, AGapOfThreeMetresInAWallIsBridged) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.tunnel.centerline = geometry::Path();  // the stations stand at whole metres
  scene.walls.left.curve = {{4.0, 1.6}, {7.0, 1.6}};
  EXPECT_NEAR(check.of(scene).clearance_left, 1.6 - kHalfTruck, 1e-6);
}

TEST(Envelope, AWallWithoutAPointIsNone) {
  Check check;
  Scene scene = straightScene(0.0);
  scene.walls.left.curve.clear();
  EXPECT_FALSE(check.of(scene).clearance_left < 10.0);
  check.odom.x = 2.0;
  EXPECT_FALSE(check.of(scene).clearance_left < 10.0) << "nothing was remembered of it";
  EXPECT_NEAR(check.envelope.result().clearance_right, 2.5 - kHalfTruck, 0.01);
}

TEST(Envelope, TheCorridorIsDrawnFromTailToFront) {
  Check check;
  const Envelope::Result& result = check.of(straightScene(0.0));
  ASSERT_EQ(result.corridor_left.size(), result.corridor_right.size());
  ASSERT_GT(result.corridor_left.size(), 10u);
  EXPECT_LT(result.corridor_left.front().x(), -5.0);
  EXPECT_GT(result.corridor_left.back().x(), 6.0);
  EXPECT_NEAR(result.corridor_left.back().y(), kHalfTruck, 0.02);
  EXPECT_NEAR(result.corridor_right.back().y(), -kHalfTruck, 0.02);
}

TEST(Envelope, TheCorridorIsCutAcrossEachOfTheBodies) {
  Check check;
  check.articulation = check.commanded = 0.5;
  const Envelope::Result& result = check.of(Scene());
  EXPECT_NEAR((result.corridor_left.front() - result.corridor_right.front()).norm(), 2.0 * kHalfTruck,
              0.1);
}

TEST(Envelope, EachScansCorridorIsDrawnAnew) {
  Check check;
  const std::size_t size = check.of(straightScene(0.0)).corridor_left.size();
  EXPECT_EQ(check.of(straightScene(0.0)).corridor_left.size(), size);
  EXPECT_EQ(check.envelope.result().corridor_right.size(), size);
}

// A lone return this far outside of the corridor's edge, between each two stations ahead whose edge
// changes: at how many of these places does it end the free distance, and of how many?
std::pair<int, int> obstaclesBeyond(double outside, bool left) {
  Check check;
  check.commanded = left ? -0.6 : 0.6;  // the outer edge widens along the way
  check.parameters.envelope.obstacle_points = 1;
  check.envelope = Envelope(check.parameters.envelope, check.parameters.limiter, check.truck);
  Scene scene = straightScene(0.0, 0.0, 30.0);
  scene.tunnel.centerline = geometry::Path();  // steered as it is, not along a path
  scene.points.clear();
  const Envelope::Result drawn = check.of(scene);
  const auto& edge = left ? drawn.corridor_left : drawn.corridor_right;
  int found = 0;
  int tried = 0;
  for (std::size_t i = 0; i + 1 < edge.size(); ++i) {
    const geometry::Point along = edge[i + 1] - edge[i];
    if (edge[i].x() < 0.0 || edge[i].x() > 8.0) continue;
    const geometry::Point out =
        (left ? 1.0 : -1.0) * geometry::Point(-along.y(), along.x()).normalized();
    for (const double t : {0.25, 0.75}) {
      const geometry::Point p = edge[i] + t * along + outside * out;
      scene.points = {{p.x(), p.y()}};
      found += static_cast<int>(check.of(scene).free_until == Envelope::End::kObstacle);
      ++tried;
    }
  }
  return {found, tried};
}

// Between two stations the lateral is interpolated in the frame of the first, which in a bend is wider
// than the straight line between them.
TEST(Envelope, TheCorridorGoesOnBetweenItsStations) {
  const double margin = Check().parameters.envelope.margin;
  for (const bool left : {true, false}) {
    const auto [inside, places] = obstaclesBeyond(margin - 0.03, left);
    EXPECT_GT(places, 10);
    EXPECT_EQ(inside, places) << left;
    EXPECT_EQ(obstaclesBeyond(margin + 0.1, left).first, 0) << left;
  }
}

TEST(Envelope, StoppingDistanceIsReactionAndBraking) {
  Check check;
  EnvelopeParameters p = check.parameters.envelope;
  p.deceleration = 0.8;
  const Envelope envelope(p, check.parameters.limiter, check.truck);
  EXPECT_DOUBLE_EQ(envelope.stoppingDistance(4.0), 4.0 * p.reaction_time + 10.0);
}

// The corridor of a truck that turns its hinge, as far as its front axle is driven 6 m ahead.
Envelope::Result turning(double speed, double rate, double reaction_time, double deceleration = 1.0) {
  Check check;
  check.speed = speed;
  check.commanded = 0.6;
  check.parameters.envelope.horizon = 6.0;
  check.parameters.envelope.reaction_time = reaction_time;
  check.parameters.envelope.deceleration = deceleration;
  check.parameters.limiter.max_articulation_rate = rate;
  check.envelope = Envelope(check.parameters.envelope, check.parameters.limiter, check.truck);
  return check.of(Scene());
}

void expectSameCorridor(const Envelope::Result& a, const Envelope::Result& b) {
  ASSERT_EQ(a.corridor_left.size(), b.corridor_left.size());
  for (std::size_t i = 0; i < a.corridor_left.size(); ++i) {
    EXPECT_LT((a.corridor_left[i] - b.corridor_left[i]).norm(), 1e-9) << i;
    EXPECT_LT((a.corridor_right[i] - b.corridor_right[i]).norm(), 1e-9) << i;
  }
}

TEST(Envelope, ATruckThatStandsTurnsItsHingeAsAtHalfAMetrePerSecond) {
  // At 1 m/s without braking, twice the rate is the same turn on the same way.
  expectSameCorridor(turning(0.0, 0.2, 1.0), turning(1.0, 0.4, 10.0));
}

TEST(Envelope, ATruckThatDoesEverythingTwiceAsFastSweepsTheSameWay) {
  expectSameCorridor(turning(3.0, 0.2, 1.0, 0.5), turning(6.0, 0.4, 0.5, 2.0));
}

// A standing truck with this hinge, driven 6 m ahead: where its corridor ends.
struct EndOfWay {
  explicit EndOfWay(Check& check) {
    check.speed = 0.0;
    check.parameters.envelope.horizon = 6.0;
    check.envelope = Envelope(check.parameters.envelope, check.parameters.limiter, check.truck);
    const Envelope::Result& result = check.of(Scene());
    left = result.corridor_left.back();
    right = result.corridor_right.back();
    heading = std::atan2(right.x() - left.x(), left.y() - right.y());
  }
  geometry::Point left, right;
  double heading;
};

TEST(Envelope, AHingeThatTurnsTheTruckTooLittleMakesItCrabByHalfOfWhatIsMissing) {
  Check check;
  check.articulation = check.commanded = 0.6;
  check.response.gain = 0.5;
  check.response.disturbance = -vehicle::yawRate(check.truck, 0.5, 0.6, 0.0);  // it does not turn at all
  const double slip = -0.5 * std::tan(0.3);
  const EndOfWay end(check);
  EXPECT_NEAR(end.heading, 0.0, 1e-9);
  EXPECT_NEAR(end.right.x(), 6.0 * std::cos(slip) + 1.0, 1e-9) << "the last whole metre before the nose";
  const double way_there = 6.0 - (check.truck.front_overhang - 1.0) / std::cos(slip);
  EXPECT_NEAR(end.right.y(), way_there * std::sin(slip) - kHalfTruck, 1e-9);
}

TEST(Envelope, TheWayTurnsByTheHingeInTheMiddleOfEachMetre) {
  Check check;
  check.commanded = 0.3;
  check.parameters.limiter.max_articulation_rate = 0.2;  // 0.4 rad/m
  const double turn = vehicle::yawRate(check.truck, 1.0, 0.15, 0.3);
  EXPECT_NEAR(EndOfWay(check).heading, turn + 5.0 * vehicle::yawRate(check.truck, 1.0, 0.3, 0.0), 1e-9);
}

TEST(EnvelopeParameters, EachNumberIsRefusedBeyondItsRangeByItsName) {
  const YAML::Node file = YAML::LoadFile(kConfig + "arbiter.yaml")["envelope"];
  const auto refusal = [&](const std::string& key, double value) -> std::string {
    YAML::Node yaml = YAML::Clone(file);
    YAML::Node map = key == "offset" || key == "heading" ? yaml["follower"] : yaml;
    if (key == "obstacle_points") {
      map[key] = static_cast<int>(value);
    } else {
      map[key] = value;
    }
    try {
      loadEnvelope(config::Node(yaml, "arbiter.yaml"));
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "";
  };
  struct Range {
    std::string key;
    double lowest, highest, beyond;
  };
  for (const Range& range :
       {Range{"margin", 0.0, 2.0, 1e-4}, Range{"smallest_obstacle", 0.05, 2.0, 1e-4},
        Range{"obstacle_points", 1.0, 50.0, 1.0}, Range{"deceleration", 0.1, 5.0, 1e-4},
        Range{"reaction_time", 0.0, 3.0, 1e-4}, Range{"reserve", 0.0, 10.0, 1e-4},
        Range{"horizon", 6.0, 60.0, 1e-4}, Range{"offset", 0.01, 2.0, 1e-4},
        Range{"heading", 0.1, 10.0, 1e-4}}) {
    EXPECT_EQ(refusal(range.key, range.lowest), "");
    EXPECT_EQ(refusal(range.key, range.highest), "");
    for (const double value : {range.lowest - range.beyond, range.highest + range.beyond}) {
      EXPECT_NE(refusal(range.key, value).find(range.key), std::string::npos) << value;
    }
  }
}

}  // namespace
}  // namespace tunnel_pilot::supervision
