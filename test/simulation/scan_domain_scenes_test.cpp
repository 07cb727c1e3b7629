// drivers::ScanDomain on simulated scans: those like its training are familiar, odd ones are not.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "tunnel_pilot/drivers/inverse_ranges.h"
#include "tunnel_pilot/drivers/scan_domain.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/simulation/lidar_model.h"
#include "tunnel_pilot/simulation/simulator.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::simulation {
namespace {

using drivers::ScanDomain;
using Ranges = std::vector<float>;

const std::string kRoot = TUNNEL_PILOT_SOURCE_DIR;
constexpr double kUnsure = 0.25;

// Scans of a truck that stands about anywhere in a drift.
std::vector<Ranges> scansIn(const std::string& world_file, std::uint64_t seed, int count,
                            double dust = -1.0) {
  LidarParameters parameters = loadSimulator(config::loadFile(kRoot + "/config/simulator.yaml")).lidar;
  if (dust >= 0.0) parameters.dust.dropout_min = parameters.dust.dropout_max = dust;
  const auto filter_parameters =
      perception::loadScanFilter(config::loadFile(kRoot + "/config/scan_filter.yaml"));
  const world::World world = world::loadWorld(kRoot + "/worlds/" + world_file, {seed, false});
  const world::RayCaster caster(world.walls, LidarModel::beams(parameters));
  LidarModel lidar(parameters, seed);
  perception::ScanFilter filter(filter_parameters);
  Random random(seed, Stream::kScene);
  const auto spread = [&random](double largest) {
    const double u = random.uniform(-1.0, 1.0);
    return largest * u * std::abs(u);
  };
  const double end = world.design_line.length() - (world.design_line.closed() ? 0.0 : 30.0);
  std::vector<Ranges> scans;
  for (int i = 0; i < count; ++i) {
    const geometry::PathPoint foot = world.design_line.at(random.uniform(8.0, end));
    const geometry::Pose pose =
        geometry::Pose{foot.x, foot.y, foot.heading}.compose({0.0, spread(0.7), spread(0.25)});
    const Stamp stamp = std::chrono::milliseconds(30 * (i + 1));
    const auto& result = filter.filter(lidar.sweep(caster, pose, pose, 1.5, 0.0, stamp), {}, stamp);
    if (result.accepted) scans.push_back(result.network_scan.ranges);
  }
  return scans;
}

class ScanDomainScenes : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    std::vector<ScanDomain::Features> examples;
    Ranges inverse;
    for (std::uint64_t seed = 1001; seed <= 1020; ++seed) {
      for (const Ranges& scan : scansIn("random_drift.yaml", seed, 200)) {
        drivers::invertRanges(scan, inverse);
        examples.push_back(ScanDomain::features(inverse));
      }
    }
    domain_ = std::make_unique<ScanDomain>(ScanDomain::fit(examples), "test");
  }
  static void TearDownTestSuite() { domain_.reset(); }

  static double shareUnsure(const std::vector<Ranges>& scans) {
    Ranges inverse;
    const auto unsure = std::count_if(scans.begin(), scans.end(), [&](const Ranges& scan) {
      return !drivers::invertRanges(scan, inverse) || domain_->familiarity(inverse) < kUnsure;
    });
    return static_cast<double>(unsure) / static_cast<double>(scans.size());
  }

  static std::vector<Ranges> changed(const std::function<void(Ranges&)>& change) {
    std::vector<Ranges> scans = scansIn("random_drift.yaml", 1050, 300);
    for (Ranges& scan : scans) change(scan);
    return scans;
  }

  static std::unique_ptr<ScanDomain> domain_;
};

std::unique_ptr<ScanDomain> ScanDomainScenes::domain_;

TEST_F(ScanDomainScenes, DriftsThatWereNotAmongItsExamplesAreFamiliar) {
  std::vector<Ranges> scans;
  for (std::uint64_t seed = 1030; seed < 1036; ++seed) {
    for (Ranges& scan : scansIn("random_drift.yaml", seed, 200)) scans.push_back(std::move(scan));
  }
  EXPECT_LT(shareUnsure(scans), 0.01);
}

TEST_F(ScanDomainScenes, DustThatTakesAFifthOfTheBeamsIsFamiliar) {
  EXPECT_LT(shareUnsure(scansIn("random_drift.yaml", 1040, 500, 0.2)), 0.01);
}

TEST_F(ScanDomainScenes, AScanOfAnOpenFieldWithAFewPostsIsForeign) {
  Random random(3, Stream::kScene);
  EXPECT_GT(shareUnsure(changed([&random](Ranges& scan) {
              std::fill(scan.begin(), scan.end(), std::numeric_limits<float>::infinity());
              for (int post = 0; post < 12; ++post) {
                const auto at = static_cast<std::ptrdiff_t>(random.uniform(0.0, 755.0));
                std::fill_n(scan.begin() + at, 5, static_cast<float>(random.uniform(5.0, 35.0)));
              }
            })),
            0.99);
}

TEST_F(ScanDomainScenes, ALidarBlindOnOneSideIsMostlyForeign) {
  EXPECT_GT(shareUnsure(changed([](Ranges& scan) {
              std::fill(scan.begin() + 381, scan.end(), std::numeric_limits<float>::quiet_NaN());
            })),
            0.8);
}

TEST_F(ScanDomainScenes, RangesInAnotherUnitAreForeign) {
  for (const float factor : {0.5F, 2.0F}) {
    EXPECT_GT(shareUnsure(changed([factor](Ranges& scan) {
                for (float& range : scan) range *= factor;
              })),
              0.9)
        << factor;
  }
}

TEST_F(ScanDomainScenes, BeamsInTheWrongOrderAreForeign) {
  EXPECT_GT(shareUnsure(changed([](Ranges& scan) {
              Ranges mixed = scan;
              for (std::size_t i = 0; i < scan.size(); ++i) mixed[i] = scan[(i * 337) % scan.size()];
              scan = mixed;
            })),
            0.9);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
