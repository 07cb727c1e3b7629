#include "tunnel_pilot/perception/scan_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace tunnel_pilot::perception {
namespace {

using Rejection = ScanFilter::Rejection;

constexpr double kDegree = 0.017453292519943295;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();
const geometry::Pose kLidar{1.6, 0.0, 0.0};
const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";

ScanFilterParameters parameters() {
  return loadScanFilter(config::loadFile(kConfig + "scan_filter.yaml"));
}

// Scan between two straight walls 2.5 m away, as the lidar of `first` .. `last` degrees sees it.
geometry::Scan corridorScan(double first = -95.0, double last = 95.0, double increment = 0.25) {
  geometry::Scan scan;
  scan.stamp = fromSeconds(100.0);
  scan.angle_min = first * kDegree;
  scan.angle_increment = increment * kDegree;
  scan.range_min = 0.05;
  scan.range_max = 40.0;
  scan.ranges.resize(static_cast<std::size_t>(std::lround((last - first) / increment)) + 1);
  scan.announced_angle_max = scan.angleMax();
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const double range = 2.5 / std::abs(std::sin(scan.angle(i)));
    scan.ranges[i] = range <= 40.0 ? static_cast<float>(range) : kInf;
  }
  return scan;
}

// The next scan of a stream: later, and not the same ranges.
geometry::Scan next(geometry::Scan scan) {
  scan.stamp += fromSeconds(0.03);
  for (float& r : scan.ranges) r += 0.001F;
  return scan;
}

Rejection judge(ScanFilter& filter, const geometry::Scan& scan) {
  return filter.filter(scan, kLidar, scan.stamp).rejection;
}

Rejection judge(const geometry::Scan& scan) {
  ScanFilter filter(parameters());
  return judge(filter, scan);
}

TEST(ScanFilter, AcceptsTheTrucksScanUnchanged) {
  ScanFilter filter(parameters());
  const geometry::Scan scan = corridorScan();
  const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
  ASSERT_TRUE(result.accepted);
  ASSERT_EQ(result.network_scan.ranges.size(), 761U);
  for (std::size_t i = 0; i < 761; ++i) {
    // Farther, returns of a wall that is grazed stand too far apart to be told from dust.
    if (scan.ranges[i] > 25.0F) continue;
    EXPECT_EQ(result.network_scan.ranges[i], scan.ranges[i]) << i;
  }
  EXPECT_EQ(filter.accepted(), 1U);
  EXPECT_EQ(filter.rejected(), 0U);
}

TEST(ScanFilter, PointsAreInBaseLinkAndBeamOrder) {
  ScanFilter filter(parameters());
  const geometry::Scan scan = corridorScan();
  const pcl::PointCloud<pcl::PointXYZ>& points = *filter.filter(scan, kLidar, scan.stamp).points;
  ASSERT_GT(points.size(), 700U);
  double last_angle = -4.0;
  for (const pcl::PointXYZ& p : points.points) {
    EXPECT_NEAR(std::abs(p.y), 2.5, 1e-4);
    const double angle = std::atan2(p.y, p.x - kLidar.x);
    EXPECT_GT(angle, last_angle);
    last_angle = angle;
  }
  EXPECT_FLOAT_EQ(points.sensor_origin_.x(), 1.6F);
}

TEST(ScanFilter, CoarserAndWiderScansAreResampled) {
  ScanFilter filter(parameters());
  const geometry::Scan scan = corridorScan(-135.0, 135.0, 0.333);
  const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
  ASSERT_TRUE(result.accepted) << toString(result.rejection);
  for (int i = 0; i < 761; ++i) {
    const double angle = (-95.0 + 0.25 * i) * kDegree;
    const double truth = 2.5 / std::abs(std::sin(angle));
    if (truth > 10.0) continue;
    EXPECT_NEAR(result.network_scan.ranges[i], truth, 0.02) << i;
  }
}

TEST(ScanFilter, BeamsOutsideTheViewAreMarkedNotInvented) {
  ScanFilter filter(parameters());
  const geometry::Scan scan = corridorScan(-90.0, 90.0, 1.0);
  const std::vector<float>& ranges = filter.filter(scan, kLidar, scan.stamp).network_scan.ranges;
  ASSERT_EQ(ranges.size(), 761U);
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(std::isnan(ranges[i]) && std::isnan(ranges[760 - i])) << i;
  }
  EXPECT_NEAR(ranges[20], 2.5, 1e-5);
  EXPECT_NEAR(ranges[740], 2.5, 1e-5);
}

TEST(ScanFilter, ATurnedLidarsScanIsTurnedBack) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan(-135.0, 135.0, 0.25);
  const double mount = 20.0 * kDegree;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    scan.ranges[i] = static_cast<float>(std::min(39.0, 2.5 / std::abs(std::sin(scan.angle(i) + mount))));
  }
  const ScanFilter::Result& result = filter.filter(scan, {1.6, 0.0, mount}, scan.stamp);
  ASSERT_TRUE(result.accepted);
  EXPECT_NEAR(result.network_scan.ranges[20], 2.5, 1e-4);
  EXPECT_NEAR(result.network_scan.ranges[740], 2.5, 1e-4);
  EXPECT_NEAR(result.network_scan.angle_min, -115.0 * kDegree, 1e-9);
}

TEST(ScanFilter, LessThanNinetyDegreesEitherSideIsRefused) {
  EXPECT_EQ(judge(corridorScan(-90.0, 90.0, 0.5)), Rejection::kNone);
  EXPECT_EQ(judge(corridorScan(-89.0, 95.0, 0.5)), Rejection::kFieldOfView);
  EXPECT_EQ(judge(corridorScan(-95.0, 89.0, 0.5)), Rejection::kFieldOfView);
}

TEST(ScanFilter, NumberOfRangesMustSuitTheAngles) {
  geometry::Scan scan = corridorScan();
  scan.ranges.pop_back();
  EXPECT_EQ(judge(scan), Rejection::kWrongSize);
  scan.ranges.resize(763, 2.0F);
  EXPECT_EQ(judge(scan), Rejection::kWrongSize);
  scan.ranges.clear();
  EXPECT_EQ(judge(scan), Rejection::kWrongSize);
}

TEST(ScanFilter, SenselessHeadersAreMalformed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto with = [](double geometry::Scan::*field, double value) {
    geometry::Scan scan = corridorScan();
    scan.*field = value;
    return judge(scan);
  };
  EXPECT_EQ(with(&geometry::Scan::angle_increment, 0.0), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::angle_increment, -0.004), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::angle_increment, nan), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::angle_increment, 1e308), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::angle_min, nan), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::angle_min, -1e308), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::range_min, nan), Rejection::kMalformed);
  EXPECT_EQ(with(&geometry::Scan::range_max, 0.01), Rejection::kMalformed);
}

TEST(ScanFilter, ASensorsPoseThatIsNoNumberIsMalformed) {
  const geometry::Scan scan = corridorScan();
  for (double geometry::Pose::*field :
       {&geometry::Pose::x, &geometry::Pose::y, &geometry::Pose::heading}) {
    ScanFilter filter(parameters());
    geometry::Pose sensor = kLidar;
    sensor.*field = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(filter.filter(scan, sensor, scan.stamp).rejection, Rejection::kMalformed);
  }
}

TEST(ScanFilter, AnotherGeometryThanTheFirstIsRejectedUntilReset) {
  ScanFilter filter(parameters());
  EXPECT_EQ(judge(filter, corridorScan()), Rejection::kNone);
  const geometry::Scan other = next(corridorScan(-95.0, 95.0, 0.5));
  EXPECT_EQ(judge(filter, other), Rejection::kGeometryChanged);
  filter.reset();
  EXPECT_EQ(judge(filter, other), Rejection::kNone);
}

TEST(ScanFilter, AllNanAllInfiniteAndNegativeAreRejected) {
  geometry::Scan scan = corridorScan();
  scan.ranges.assign(761, kNan);
  EXPECT_EQ(judge(scan), Rejection::kAllNan);
  scan.ranges.assign(761, kInf);
  EXPECT_EQ(judge(scan), Rejection::kAllInfinite);
  scan.ranges.assign(761, -kInf);
  EXPECT_EQ(judge(scan), Rejection::kAllInfinite);
  scan = corridorScan();
  scan.ranges[17] = -1.0F;
  EXPECT_EQ(judge(scan), Rejection::kNegative);
}

TEST(ScanFilter, NoEchoCodesOutsideTheLimitsAreNoReturns) {
  for (const float code : {0.0F, 0.002F, 8.19F, 81.9F, kInf, -kInf, kNan}) {
    ScanFilter filter(parameters());
    geometry::Scan scan = corridorScan();
    scan.range_max = 8.0;
    for (float& r : scan.ranges) r = std::min(r, 7.9F);
    for (std::size_t i = 200; i < 300; ++i) scan.ranges[i] = code;
    const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
    ASSERT_TRUE(result.accepted) << code;
    EXPECT_EQ(result.points->size(), 661U) << code;
    for (std::size_t i = 200; i < 300; ++i) EXPECT_FALSE(std::isfinite(result.network_scan.ranges[i]));
  }
  geometry::Scan scan = corridorScan();
  scan.ranges.assign(761, 0.002F);
  EXPECT_EQ(judge(scan), Rejection::kNoReturns);
}

TEST(ScanFilter, InfinityStaysInfinityForTheNetwork) {
  ScanFilter filter(parameters());
  const geometry::Scan scan = corridorScan();
  EXPECT_EQ(filter.filter(scan, kLidar, scan.stamp).network_scan.ranges[380], kInf);
}

TEST(ScanFilter, AnIdenticalScanIsFrozenAndTheNextFreshOneIsNot) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  EXPECT_EQ(judge(filter, scan), Rejection::kNone);
  for (int i = 0; i < 3; ++i) {
    scan.stamp += fromSeconds(0.03);
    EXPECT_EQ(judge(filter, scan), Rejection::kFrozen);
  }
  EXPECT_EQ(judge(filter, next(scan)), Rejection::kNone);
}

TEST(ScanFilter, FrozenCountIsHowManyIdenticalOnesInARowAreTooMany) {
  ScanFilterParameters patient = parameters();
  patient.frozen_count = 3;
  ScanFilter filter(patient);
  geometry::Scan scan = corridorScan();
  for (const Rejection expected : {Rejection::kNone, Rejection::kNone, Rejection::kFrozen}) {
    EXPECT_EQ(judge(filter, scan), expected);
    scan.stamp += fromSeconds(0.03);
  }
}

// Found by the campaign at the level of ROS: bad scans, a jump of the clock, then frozen ones.
TEST(ScanFilter, ASensorThatWasFrozenStaysSoOverAReset) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  EXPECT_EQ(judge(filter, scan), Rejection::kNone);
  filter.reset();
  scan.stamp += fromSeconds(0.3);
  EXPECT_EQ(judge(filter, scan), Rejection::kFrozen);
}

// Found there, too.
TEST(ScanFilter, AScanThatCannotBeUsedFreshensNoFrozenSensor) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  EXPECT_EQ(judge(filter, scan), Rejection::kNone);
  for (const auto& [bad, why] :
       {std::pair(-1.0F, Rejection::kNegative), std::pair(kNan, Rejection::kAllNan),
        std::pair(kInf, Rejection::kAllInfinite)}) {
    geometry::Scan spoilt = scan;
    spoilt.ranges.assign(scan.ranges.size(), bad);
    spoilt.stamp += fromSeconds(0.03);
    EXPECT_EQ(judge(filter, spoilt), why);
    scan.stamp += fromSeconds(0.03);
    EXPECT_EQ(judge(filter, scan), Rejection::kFrozen);
  }
}

TEST(ScanFilter, FrozenIsSeenThroughNanBeamsToo) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  scan.ranges[5] = kNan;
  Rejection last = Rejection::kNone;
  for (int i = 0; i < 3; ++i, scan.stamp += fromSeconds(0.03)) last = judge(filter, scan);
  EXPECT_EQ(last, Rejection::kFrozen);
}

TEST(ScanFilter, StampsAreJudgedToTheMillisecond) {
  const geometry::Scan scan = corridorScan();
  const auto at_age = [&](double age) {
    ScanFilter filter(parameters());
    return filter.filter(scan, kLidar, scan.stamp + fromSeconds(age)).rejection;
  };
  EXPECT_EQ(at_age(0.149), Rejection::kNone);
  EXPECT_EQ(at_age(0.151), Rejection::kTooOld);
  EXPECT_EQ(at_age(-0.049), Rejection::kNone);
  EXPECT_EQ(at_age(-0.051), Rejection::kFuture);
}

TEST(ScanFilter, AgeIsNotJudgedInReplay) {
  ScanFilterParameters replay = parameters();
  replay.check_age = false;
  ScanFilter filter(replay);
  const geometry::Scan scan = corridorScan();
  EXPECT_TRUE(filter.filter(scan, kLidar, scan.stamp + fromSeconds(1e6)).accepted);
}

TEST(ScanFilter, RepeatedAndBackwardStampsAreRejectedUntilReset) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  EXPECT_EQ(judge(filter, scan), Rejection::kNone);
  EXPECT_EQ(judge(filter, scan), Rejection::kRepeated);
  geometry::Scan earlier = next(scan);
  earlier.stamp = scan.stamp - Stamp(1);
  EXPECT_EQ(judge(filter, earlier), Rejection::kBackward);
  filter.reset();
  EXPECT_EQ(judge(filter, earlier), Rejection::kNone);
}

TEST(ScanFilter, ARejectedFutureScanDoesNotBlockTheOnesAfterIt) {
  ScanFilter filter(parameters());
  geometry::Scan ahead = corridorScan();
  const Stamp now = ahead.stamp;
  ahead.stamp += fromSeconds(3600.0);
  EXPECT_EQ(filter.filter(ahead, kLidar, now).rejection, Rejection::kFuture);
  EXPECT_EQ(filter.filter(next(corridorScan()), kLidar, now).rejection, Rejection::kNone);
}

TEST(ScanFilter, RejectionsAreCountedByReasonAndGiveNoData) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  judge(filter, scan);
  judge(filter, scan);
  const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
  EXPECT_FALSE(result.accepted);
  EXPECT_TRUE(result.points->empty());
  EXPECT_TRUE(result.network_scan.ranges.empty());
  EXPECT_EQ(filter.count(Rejection::kRepeated), 2U);
  EXPECT_EQ(filter.accepted(), 1U);
  EXPECT_EQ(filter.rejected(), 2U);
}

TEST(ScanFilter, ValidFractionIsToldPerSector) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  for (float& r : scan.ranges) r = std::min(r, 30.0F);
  for (std::size_t i = 0; i < 760; ++i) {
    const double degrees = -95.0 + 0.25 * static_cast<double>(i);
    if (degrees > 30.0) scan.ranges[i] = kNan;                          // nothing on the left
    if (std::abs(degrees) <= 30.0 && i % 8 < 4) scan.ranges[i] = kNan;  // half of the front
  }
  const std::array<double, 3> fraction = filter.filter(scan, kLidar, scan.stamp).valid_fraction;
  EXPECT_NEAR(fraction[0], 0.0, 0.01);
  EXPECT_NEAR(fraction[1], 0.5, 0.02);
  EXPECT_DOUBLE_EQ(fraction[2], 1.0);
}

TEST(ScanFilter, DustIsRemovedFromThePointsAndFilledForTheNetwork) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  const float wall = scan.ranges[100];
  scan.ranges[100] = 0.7F;
  const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
  for (const pcl::PointXYZ& p : result.points->points) EXPECT_NEAR(std::abs(p.y), 2.5, 1e-4);
  EXPECT_NEAR(result.network_scan.ranges[100], wall, 0.02);
}

TEST(ScanFilter, ObstaclesOfFortyCentimetresArePointsUpToTwentyMetres) {
  for (const double range : {2.0, 5.0, 10.0, 15.0, 20.0}) {
    ScanFilter filter(parameters());
    geometry::Scan scan = corridorScan();
    const double half = std::atan(0.2 / range);
    std::size_t put = 0;
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      if (std::abs(scan.angle(i)) > half) continue;
      scan.ranges[i] = static_cast<float>(range);
      ++put;
    }
    const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
    std::size_t seen = 0;
    for (const pcl::PointXYZ& p : result.points->points) seen += std::abs(p.y) < 0.25 ? 1U : 0U;
    EXPECT_EQ(seen, put) << range;
  }
}

TEST(ScanFilter, WideGapsStayGaps) {
  ScanFilter filter(parameters());
  geometry::Scan scan = corridorScan();
  for (std::size_t i = 100; i < 108; ++i) scan.ranges[i] = kNan;
  for (std::size_t i = 200; i < 210; ++i) scan.ranges[i] = kNan;
  const std::vector<float>& ranges = filter.filter(scan, kLidar, scan.stamp).network_scan.ranges;
  for (std::size_t i = 100; i < 108; ++i) EXPECT_TRUE(std::isfinite(ranges[i]));
  for (std::size_t i = 200; i < 210; ++i) EXPECT_TRUE(std::isnan(ranges[i]));
}

TEST(ScanFilter, AHeldCloudIsNotOverwritten) {
  ScanFilter filter(parameters());
  const geometry::Scan scan = corridorScan();
  const pcl::PointCloud<pcl::PointXYZ>::Ptr held = filter.filter(scan, kLidar, scan.stamp).points;
  const std::size_t size = held->size();
  geometry::Scan later = next(scan);
  for (float& r : later.ranges) r = std::min(r, 1.0F);
  filter.filter(later, kLidar, later.stamp);
  ASSERT_EQ(held->size(), size);
  EXPECT_NEAR(std::abs(held->points[0].y), 2.5, 1e-4);
}

// Whatever comes: no exception, no range outside the limits, counters that add up.
TEST(ScanFilter, RandomScansNeverThrowNorLeakBadRanges) {
  std::mt19937_64 random(7);
  const std::vector<float> odd = {kNan, kInf, -kInf, 0.0F, 0.002F, 81.9F, 1e30F, -1.0F, 1e-40F};
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  ScanFilter filter(parameters());
  std::uint64_t calls = 0;
  for (int round = 0; round < 3000; ++round) {
    if (unit(random) < 0.7) filter.reset();
    geometry::Scan scan =
        corridorScan(-90.0 - 50.0 * unit(random), 90.0 + 50.0 * unit(random), 0.25 + unit(random));
    const double share = unit(random) * unit(random);
    for (float& r : scan.ranges) {
      if (unit(random) < share) r = odd[random() % (unit(random) < 0.9 ? 7 : odd.size())];
    }
    if (unit(random) < 0.1) scan.ranges.resize(random() % 2000, 1.0F);
    if (unit(random) < 0.05) scan.angle_increment = odd[random() % odd.size()];
    if (unit(random) < 0.05) scan.range_max = odd[random() % odd.size()];
    scan.stamp = Stamp(static_cast<std::int64_t>(random() % 1000000000));
    const ScanFilter::Result& result = filter.filter(scan, kLidar, scan.stamp);
    ++calls;
    ASSERT_EQ(result.accepted, result.rejection == Rejection::kNone);
    for (const pcl::PointXYZ& p : result.points->points) {
      const double range = std::hypot(p.x - kLidar.x, p.y);
      ASSERT_TRUE(range >= 0.0999 && range <= 40.001) << range;
    }
    for (const float r : result.network_scan.ranges) {
      ASSERT_TRUE(std::isnan(r) || r == kInf || (r >= 0.1F && r <= 40.0F)) << r;
    }
    for (const double f : result.valid_fraction) ASSERT_TRUE(f >= 0.0 && f <= 1.0);
  }
  EXPECT_EQ(filter.accepted() + filter.rejected(), calls);
  EXPECT_GT(filter.accepted(), 500U);
}

}  // namespace
}  // namespace tunnel_pilot::perception
