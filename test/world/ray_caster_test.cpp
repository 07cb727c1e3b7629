#include "tunnel_pilot/world/ray_caster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <new>
#include <random>

// Bytes asked of the heap by this program, so that tests can tell what a call takes.
static std::size_t g_allocated = 0;

void* operator new(std::size_t size) {
  g_allocated += size;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace tunnel_pilot::world {
namespace {

using geometry::Point;
using geometry::Pose;

constexpr double kDegree = M_PI / 180.0;
constexpr double kTolerance = 2e-3;  // of a range [m]
const float kNothing = std::numeric_limits<float>::infinity();
const RayCaster::Beams kScan{-95.0 * kDegree, 0.25 * kDegree, 761, 40.0};

// The range by definition: every segment, in double.
double rangeByDefinition(const std::vector<WallChain>& walls, const Pose& sensor, double angle,
                         double range_max) {
  const Point beam(std::cos(sensor.heading + angle), std::sin(sensor.heading + angle));
  double best = std::numeric_limits<double>::infinity();
  for (const WallChain& chain : walls) {
    for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
      const Point start = chain[i] - sensor.position();
      const Point along = chain[i + 1] - chain[i];
      const double turn = beam.x() * along.y() - beam.y() * along.x();
      const double range = (start.x() * along.y() - start.y() * along.x()) / turn;
      const double share = (start.x() * beam.y() - start.y() * beam.x()) / turn;
      if (range >= 0.0 && share >= 0.0 && share <= 1.0) best = std::min(best, range);
    }
  }
  return best <= range_max ? best : std::numeric_limits<double>::infinity();
}

// Beams whose range is not the true one. Within 1e-9 rad of an edge either side of it may be seen.
int wrongBeams(const std::vector<WallChain>& walls, const RayCaster::Beams& beams, const Pose& sensor,
               const std::vector<float>& ranges) {
  int wrong = 0;
  for (int i = 0; i < beams.count; ++i) {
    const double angle = beams.angle_min + i * beams.angle_increment;
    const double ours = ranges[static_cast<std::size_t>(i)];
    bool right = false;
    for (const double nudge : {0.0, -1e-9, 1e-9}) {
      const double truth = rangeByDefinition(walls, sensor, angle + nudge, beams.range_max);
      right = right || ours == truth || std::abs(ours - truth) <= kTolerance;
    }
    if (!right) ++wrong;
  }
  return wrong;
}

// Polylines that wander about, some crossing others: nothing of a tunnel's regularity.
std::vector<WallChain> randomWalls(std::mt19937& engine, Point centre = {0.0, 0.0}) {
  std::uniform_real_distribution<double> place(-30.0, 30.0), turn(-1.0, 1.0), step(0.02, 3.0);
  std::uniform_int_distribution<int> count(2, 60);
  std::vector<WallChain> walls;
  for (int k = 0; k < 8; ++k) {
    WallChain chain{centre + Point(place(engine), place(engine))};
    double heading = 3.0 * turn(engine);
    for (int i = count(engine); i > 0; --i) {
      heading += turn(engine);
      chain.push_back(chain.back() + step(engine) * Point(std::cos(heading), std::sin(heading)));
    }
    walls.push_back(chain);
  }
  return walls;
}

Pose randomPose(std::mt19937& engine) {
  std::uniform_real_distribution<double> place(-20.0, 20.0), heading(-M_PI, M_PI);
  return {place(engine), place(engine), heading(engine)};
}

const std::vector<WallChain> kRoom = {
    {{-3.0, -2.0}, {5.0, -2.0}, {5.0, 4.0}, {-3.0, 4.0}, {-3.0, -2.0}}};

TEST(RayCaster, RoomHasTheRangesOneCanReckon) {
  const RayCaster caster(kRoom, {-90.0 * kDegree, 90.0 * kDegree, 3, 40.0});
  std::vector<float> ranges;
  caster.cast({0.0, 0.0, 0.0}, ranges);
  EXPECT_NEAR(ranges[0], 2.0, 1e-6);
  EXPECT_NEAR(ranges[1], 5.0, 1e-6);
  EXPECT_NEAR(ranges[2], 4.0, 1e-6);
  caster.cast({1.0, 1.0, 45.0 * kDegree}, ranges);
  EXPECT_NEAR(ranges[1], 3.0 * std::sqrt(2.0), 1e-6);
}

TEST(RayCaster, NothingWithinReachIsInfinity) {
  const RayCaster caster(kRoom, {0.0, 0.1, 2, 4.5});
  std::vector<float> ranges;
  caster.cast({0.0, 0.0, 0.0}, ranges);
  EXPECT_EQ(ranges[0], kNothing);
  caster.cast({1.0, 0.0, 0.0}, ranges);
  EXPECT_NEAR(ranges[0], 4.0, 1e-6);
}

TEST(RayCaster, RandomWorldsAreExactToTwoMillimetres) {
  std::mt19937 engine(7);
  int wrong = 0;
  for (int k = 0; k < 20; ++k) {
    const std::vector<WallChain> walls = randomWalls(engine);
    const RayCaster caster(walls, kScan);
    std::vector<float> ranges;
    for (int i = 0; i < 15; ++i) {
      const Pose sensor = randomPose(engine);
      caster.cast(sensor, ranges);
      wrong += wrongBeams(walls, kScan, sensor, ranges);
    }
  }
  EXPECT_EQ(wrong, 0);
}

TEST(RayCaster, FullTurnAndCoarseScansAreExactToo) {
  std::mt19937 engine(8);
  const std::vector<RayCaster::Beams> scans = {{-M_PI, 2.0 * M_PI / 720.0, 720, 30.0},
                                               {0.0, 2.0 * M_PI / 1440.0, 1441, 60.0},
                                               {0.3, 0.07, 11, 25.0},
                                               {1.0, 0.01, 1, 25.0}};
  for (const RayCaster::Beams& beams : scans) {
    int wrong = 0;
    for (int k = 0; k < 20; ++k) {
      const std::vector<WallChain> walls = randomWalls(engine);
      const Pose sensor = randomPose(engine);
      std::vector<float> ranges;
      RayCaster(walls, beams).cast(sensor, ranges);
      wrong += wrongBeams(walls, beams, sensor, ranges);
    }
    EXPECT_EQ(wrong, 0) << beams.count << " beams";
  }
}

TEST(RayCaster, FarFromTheOriginItIsAsExact) {
  std::mt19937 engine(9);
  const Point far(4.0e5, -7.0e5);
  int wrong = 0;
  for (int k = 0; k < 20; ++k) {
    const std::vector<WallChain> walls = randomWalls(engine, far);
    Pose sensor = randomPose(engine);
    sensor.x += far.x();
    sensor.y += far.y();
    std::vector<float> ranges;
    RayCaster(walls, kScan).cast(sensor, ranges);
    wrong += wrongBeams(walls, kScan, sensor, ranges);
  }
  EXPECT_EQ(wrong, 0);
}

// Polygons whose vertices lie on beams, or beside them by some rounding: where a caster leaks if it
// leaks.
TEST(RayCaster, ClosedOutlinesLetNoBeamThrough) {
  std::mt19937 engine(10);
  std::uniform_real_distribution<double> radius(2.0, 30.0), tiny(-1e-6, 1e-6);
  for (int k = 0; k < 40; ++k) {
    WallChain outline;
    for (int i = 0; i < 1440; i += 1 + k % 4) {
      const double angle = i * kScan.angle_increment + (k % 2 == 0 ? 0.0 : tiny(engine));
      const double r = radius(engine);
      outline.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
    outline.push_back(outline.front());
    std::vector<float> ranges;
    RayCaster({outline}, kScan).cast({0.0, 0.0, 0.0}, ranges);
    for (const float range : ranges) ASSERT_TRUE(range > 1.9F && range < 30.1F) << range;
  }
}

// A corner some nanoradians beside a beam: it hides the wall behind it, or it does not.
TEST(RayCaster, CornersHideNoMoreAndNoLessThanTheyDo) {
  std::mt19937 engine(13);
  std::uniform_real_distribution<double> beside(2e-9, 1e-6);
  std::uniform_int_distribution<int> beams(100, 660);
  for (int k = 0; k < 1000; ++k) {
    const int beam = beams(engine);
    const bool hides = k % 2 == 0;
    const double angle =
        kScan.angle_min + beam * kScan.angle_increment + (hides ? 1.0 : -1.0) * beside(engine);
    const Point corner(3.0 * std::cos(angle), 3.0 * std::sin(angle));
    const Point end(3.0 * std::cos(angle - 0.2), 3.0 * std::sin(angle - 0.2));
    std::vector<float> ranges;
    RayCaster({{corner, end}}, kScan).cast({0.0, 0.0, 0.0}, ranges);
    ASSERT_EQ(std::isfinite(ranges[static_cast<std::size_t>(beam)]), hides) << k;
  }
}

TEST(RayCaster, SectorsMakeTheSameScanBitByBit) {
  std::mt19937 engine(11);
  const RayCaster caster(randomWalls(engine), kScan);
  const Pose sensor{1.0, 2.0, 0.4};
  std::vector<float> whole, parts(761, -1.0F);
  caster.cast(sensor, whole);
  for (const auto& [first, last] : {std::pair(0, 48), std::pair(48, 49), std::pair(49, 49),
                                    std::pair(49, 700), std::pair(700, 761)}) {
    caster.cast(sensor, parts.data(), first, last);
  }
  EXPECT_EQ(whole, parts);
}

TEST(RayCaster, SectorsLeaveTheOtherBeamsAlone) {
  const RayCaster caster(kRoom, kScan);
  std::vector<float> ranges(761, -1.0F);
  caster.cast({0.0, 0.0, 0.0}, ranges.data(), 100, 200);
  EXPECT_EQ(ranges[99], -1.0F);
  EXPECT_GT(ranges[100], 0.0F);
  EXPECT_GT(ranges[199], 0.0F);
  EXPECT_EQ(ranges[200], -1.0F);
}

TEST(RayCaster, MovingChainsHideTheWallsBehindThemUntilTheyAreGone) {
  RayCaster caster(kRoom, {-0.1, 0.1, 3, 40.0});
  std::vector<float> ranges;
  caster.setMovingChains({{{2.0, -0.5}, {2.0, 0.15}}});
  caster.cast({0.0, 0.0, 0.0}, ranges);
  EXPECT_NEAR(ranges[1], 2.0, 1e-6);
  EXPECT_NEAR(ranges[2], 5.0 / std::cos(0.1), 1e-5);
  caster.setMovingChains({});
  caster.cast({0.0, 0.0, 0.0}, ranges);
  EXPECT_NEAR(ranges[1], 5.0, 1e-6);
}

TEST(RayCaster, WallSeenEdgeOnIsMetAtItsNearerEnd) {
  const RayCaster caster({{{9.0, 0.0}, {4.0, 0.0}}}, {-0.1, 0.1, 3, 40.0});
  std::vector<float> ranges;
  caster.cast({0.0, 0.0, 0.0}, ranges);
  EXPECT_EQ(ranges[0], kNothing);
  EXPECT_NEAR(ranges[1], 4.0, 1e-6);
  EXPECT_EQ(ranges[2], kNothing);
}

TEST(RayCaster, SensorOnAWallNeverYieldsNotANumber) {
  const RayCaster caster(kRoom, kScan);
  std::vector<float> ranges;
  for (const Pose& sensor : {Pose{5.0, 0.0, 0.3}, Pose{5.0, 4.0, 0.0}, Pose{-3.0, 1.0, M_PI / 2.0}}) {
    caster.cast(sensor, ranges);
    for (const float range : ranges) EXPECT_TRUE(range >= 0.0F);
  }
}

TEST(RayCaster, CastingTakesNoMemory) {
  std::mt19937 engine(12);
  const RayCaster caster(randomWalls(engine), kScan);
  std::vector<float> ranges(761);
  const std::size_t before = g_allocated;
  caster.cast({0.0, 0.0, 0.0}, ranges.data(), 0, 761);
  EXPECT_EQ(g_allocated, before);
}

TEST(RayCaster, FourHundredSegmentsTakeLessThanAMegabyte) {
  WallChain left, right;
  for (int i = 0; i <= 200; ++i) {
    left.emplace_back(0.5 * i, 2.5);
    right.emplace_back(0.5 * i, -2.5);
  }
  const std::vector<WallChain> walls = {left, right};
  const std::size_t before = g_allocated;
  const RayCaster caster(walls, kScan);
  EXPECT_LT(g_allocated - before, 1000000U);
}

TEST(RayCaster, ImpossibleBeamsAreRefused) {
  const std::vector<RayCaster::Beams> impossible = {
      {0.0, 0.1, 0, 40.0},   {0.0, 0.0, 10, 40.0}, {0.0, -0.1, 10, 40.0}, {NAN, 0.1, 10, 40.0},
      {0.0, 0.1, 100, 40.0}, {0.0, 0.1, 10, 0.0},  {0.0, 0.1, 10, NAN},   {0.0, 1e-5, 100000, 40.0}};
  for (const RayCaster::Beams& beams : impossible) {
    EXPECT_THROW(RayCaster(kRoom, beams), std::invalid_argument) << beams.count;
  }
}

TEST(RayCaster, BeamsOutsideTheScanAreRefused) {
  const RayCaster caster(kRoom, kScan);
  std::vector<float> ranges(761);
  EXPECT_THROW(caster.cast({}, ranges.data(), -1, 5), std::invalid_argument);
  EXPECT_THROW(caster.cast({}, ranges.data(), 0, 762), std::invalid_argument);
  EXPECT_THROW(caster.cast({}, ranges.data(), 6, 5), std::invalid_argument);
}

TEST(RayCaster, PosesThatAreNotFiniteAreRefused) {
  const RayCaster caster(kRoom, kScan);
  std::vector<float> ranges;
  EXPECT_THROW(caster.cast({NAN, 0.0, 0.0}, ranges), std::invalid_argument);
  EXPECT_THROW(caster.cast({0.0, 0.0, INFINITY}, ranges), std::invalid_argument);
}

TEST(RayCaster, WallsThatAreNotFiniteAreRefused) {
  EXPECT_THROW(RayCaster({{{0.0, 0.0}, {NAN, 1.0}}}, kScan), std::invalid_argument);
}

}  // namespace
}  // namespace tunnel_pilot::world
