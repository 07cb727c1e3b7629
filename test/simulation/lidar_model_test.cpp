#include "tunnel_pilot/simulation/lidar_model.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kPi = 3.141592653589793;

LidarParameters shipped() {
  return loadLidar(config::loadFile(TUNNEL_PILOT_SOURCE_DIR "/config/simulator.yaml").child("lidar"));
}

LidarParameters withoutDust() {
  LidarParameters lidar = shipped();
  lidar.dust.dropout_min = lidar.dust.dropout_max = lidar.dust.burst_rate = 0.0;
  return lidar;
}

LidarParameters exact() {
  LidarParameters lidar = withoutDust();
  lidar.range_sigma = lidar.range_bias_max = 0.0;
  return lidar;
}

// A square room around the origin, walls 5 m away.
std::vector<world::WallChain> room() {
  return {{{5.0, -5.0}, {5.0, 5.0}, {-5.0, 5.0}, {-5.0, -5.0}, {5.0, -5.0}}};
}

struct Bench {
  LidarParameters parameters;
  world::RayCaster caster;
  LidarModel lidar;

  explicit Bench(const LidarParameters& p, std::uint64_t seed = 1000,
                 const std::vector<world::WallChain>& walls = room())
      : parameters(p), caster(walls, LidarModel::beams(p)), lidar(p, seed) {}

  const geometry::Scan& sweep(const geometry::Pose& first, const geometry::Pose& last, int i = 0,
                              double pitch = 0.0) {
    return lidar.sweep(caster, first, last, 1.5, pitch, fromSeconds(i / parameters.rate));
  }
};

// The line of the plant acceptance: the histogram of range errors is a normal distribution with the
// stated sigma round the unit's stated bias.
TEST(LidarModel, RangeHistogramMatchesStatedSigmaAndBias) {
  const LidarParameters parameters = withoutDust();
  ASSERT_DOUBLE_EQ(parameters.range_sigma, 0.012);
  ASSERT_DOUBLE_EQ(parameters.range_bias_max, 0.030);
  Bench noisy(parameters), ideal(exact());
  const geometry::Scan truth = ideal.sweep({}, {});
  std::array<int, 12> histogram{};  // by half sigma, from -3 to 3
  double sum = 0.0, squares = 0.0;
  int count = 0;
  for (int i = 0; i < 500; ++i) {
    const geometry::Scan& scan = noisy.sweep({}, {}, i);
    for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
      const double error = double{scan.ranges[beam]} - double{truth.ranges[beam]};
      sum += error;
      squares += error * error;
      ++count;
      const double z = (error - noisy.lidar.bias()) / 0.012;
      if (std::abs(z) < 3.0) ++histogram.at(static_cast<std::size_t>((z + 3.0) * 2.0));
    }
  }
  const double mean = sum / count;
  EXPECT_NEAR(mean, noisy.lidar.bias(), 5 * 0.012 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count - mean * mean), 0.012, 0.0001);
  for (std::size_t bin = 0; bin < histogram.size(); ++bin) {
    const double low = -3.0 + 0.5 * static_cast<double>(bin);
    const double share =
        0.5 * (std::erfc(-(low + 0.5) / std::sqrt(2.0)) - std::erfc(-low / std::sqrt(2.0)));
    EXPECT_NEAR(histogram[bin], share * count, 5 * std::sqrt(share * count))
        << "bin at " << low << " sigma";
  }
}

TEST(LidarModel, BiasesOfManyUnitsFillThirtyMillimetresEitherWay) {
  double low = 0.0, high = 0.0;
  for (std::uint64_t seed = 1000; seed < 2000; ++seed) {
    const double bias = LidarModel(shipped(), seed).bias();
    low = std::min(low, bias);
    high = std::max(high, bias);
  }
  EXPECT_NEAR(low, -0.030, 0.0005);
  EXPECT_NEAR(high, 0.030, 0.0005);
}

TEST(LidarModel, Sees190DegreesIn761Beams35TimesASecond) {
  Bench bench(exact());
  const geometry::Scan& scan = bench.sweep({}, {});
  ASSERT_EQ(scan.ranges.size(), 761u);
  EXPECT_NEAR(scan.angle_min, -95.0 * kPi / 180, 1e-6);
  EXPECT_NEAR(scan.angleMax(), 95.0 * kPi / 180, 1e-5);
  EXPECT_NEAR(scan.time_increment, 0.25 / 360 / 35, 1e-10);
  EXPECT_NEAR(scan.ranges[380], 5.0, 1e-3) << "straight ahead";
  EXPECT_NEAR(scan.ranges[20], 5.0, 1e-3) << "-90 degrees";
}

TEST(LidarModel, RotationSkewsAScanTakenInMotion) {
  LidarParameters fine = exact();
  fine.sectors = fine.beams;  // a pose for every beam: the exact answer
  Bench ideal(fine), bench(exact());
  const geometry::Pose first{0.0, 0.0, 0.0}, last{0.08, 0.0, 0.0075};  // 5 m/s, 0.5 rad/s
  const geometry::Scan truth = ideal.sweep(first, last);
  const geometry::Scan& skewed = bench.sweep(first, last);
  const geometry::Scan still = Bench(exact()).sweep(first, first);
  double largest = 0.0, still_largest = 0.0;
  for (std::size_t i = 0; i < truth.ranges.size(); ++i) {
    largest = std::max(largest, double{std::abs(skewed.ranges[i] - truth.ranges[i])});
    still_largest = std::max(still_largest, double{std::abs(still.ranges[i] - truth.ranges[i])});
  }
  EXPECT_LT(largest, 0.012) << "the sectors' steps are within the noise";
  EXPECT_GT(still_largest, 0.04) << "a sweep from one pose would not be";
  EXPECT_NEAR(truth.ranges[0], Bench(exact()).sweep(first, first).ranges[0], 1e-5);
  EXPECT_NEAR(truth.ranges[760], Bench(exact()).sweep(last, last).ranges[760], 1e-5);
}

TEST(LidarModel, DustTakesTheStatedShareOfEchoesAndReturnsSomeEarly) {
  LidarParameters parameters = withoutDust();
  parameters.dust.dropout_min = parameters.dust.dropout_max = 0.12;
  parameters.dust.early_return_share = 0.25;
  Bench bench(parameters);
  const float clearly_early = 4.85f;
  double expected = 0.0;  // early returns are spread evenly between the lidar and the wall
  const std::vector<float> walls = Bench(exact()).sweep({}, {}).ranges;
  for (const float range : walls) {
    expected += 0.03 * (clearly_early - 0.1) / (range - 0.1) / 761;
  }
  int lost = 0, early = 0, count = 0;
  for (int i = 0; i < 400; ++i) {
    for (const float range : bench.sweep({}, {}, i).ranges) {
      ++count;
      if (std::isinf(range)) ++lost;
      if (range < clearly_early) ++early;
    }
  }
  EXPECT_NEAR(static_cast<double>(lost) / count, 0.09, 0.003);
  EXPECT_NEAR(static_cast<double>(early) / count, expected, 0.0015);
}

TEST(LidarModel, DustOfManySeedsLiesBetweenTwoAndTwentyPercent) {
  double low = 1.0, high = 0.0;
  for (std::uint64_t seed = 1000; seed < 2000; ++seed) {
    const double dropout = LidarModel(shipped(), seed).dropout();
    low = std::min(low, dropout);
    high = std::max(high, dropout);
  }
  EXPECT_NEAR(low, 0.02, 0.001);
  EXPECT_NEAR(high, 0.20, 0.001);
}

TEST(LidarModel, ABurstBlindsASectorForAWhile) {
  LidarParameters parameters = withoutDust();
  parameters.dust.burst_rate = 1.0;
  parameters.dust.burst_dropout = 1.0;
  Bench bench(parameters);
  int blind_scans = 0, blind_beams = 0;
  const int scans = 3500;
  for (int i = 0; i < scans; ++i) {
    int blind = 0;
    for (const float range : bench.sweep({}, {}, i).ranges) blind += std::isnan(range) ? 1 : 0;
    blind_scans += blind > 0 ? 1 : 0;
    blind_beams = std::max(blind_beams, blind);
  }
  EXPECT_NEAR(blind_beams, parameters.dust.burst_width / parameters.angle_increment, 2);
  // Clouds of 0.4 s, the next on average 1 s after the last went: 0.4 / 1.4 of the time.
  EXPECT_NEAR(static_cast<double>(blind_scans) / scans, 0.29, 0.08);
}

TEST(LidarModel, NothingInRangeIsPlusAndTooNearIsMinusInfinity) {
  LidarParameters parameters = exact();
  parameters.range_max = 4.0;
  EXPECT_EQ(Bench(parameters).sweep({}, {}).ranges[380], INFINITY);
  parameters.range_max = 40.0;
  parameters.range_min = 6.0;
  EXPECT_EQ(Bench(parameters).sweep({}, {}).ranges[380], -INFINITY);
}

TEST(LidarModel, APitchedDownLidarSeesTheGroundAhead) {
  Bench bench(exact(), 1000, {{{30.0, -50.0}, {30.0, 50.0}}});
  const double pitch = 0.1;
  const geometry::Scan& scan = bench.sweep({}, {}, 0, pitch);
  EXPECT_NEAR(scan.ranges[380], 1.5 / std::tan(pitch), 1e-3);
  EXPECT_NEAR(bench.sweep({}, {}, 1, -pitch).ranges[380], 30.0, 1e-3) << "pitched up it does not";
}

TEST(LidarModel, SameSeedGivesTheSameBits) {
  Bench first(shipped(), 7), second(shipped(), 7), other(shipped(), 8);
  for (int i = 0; i < 50; ++i) {
    const geometry::Scan a = first.sweep({}, {}, i), b = second.sweep({}, {}, i);
    for (std::size_t k = 0; k < a.ranges.size(); ++k) {
      ASSERT_TRUE(a.ranges[k] == b.ranges[k] || (std::isnan(a.ranges[k]) && std::isnan(b.ranges[k])));
    }
  }
  EXPECT_NE(first.sweep({}, {}, 60).ranges, other.sweep({}, {}, 60).ranges);
}

TEST(LidarParameters, ThatCannotBeAreRefused) {
  const auto refused = [](const std::string& key, const std::string& value) {
    YAML::Node yaml = YAML::LoadFile(TUNNEL_PILOT_SOURCE_DIR "/config/simulator.yaml")["lidar"];
    yaml[key] = YAML::Load(value);
    try {
      loadLidar(config::Node(yaml, "simulator.yaml"));
    } catch (const config::ConfigError& error) {
      return std::string(error.what()).find(key) != std::string::npos;
    }
    return false;
  };
  EXPECT_TRUE(refused("beams", "2000")) << "more than a turn";
  EXPECT_TRUE(refused("latency", "0.001")) << "shorter than the sweep";
  EXPECT_TRUE(refused("rate", "0"));
  EXPECT_TRUE(refused("range_sigma", "-0.1"));
  EXPECT_TRUE(refused("sectors", "0"));
  EXPECT_TRUE(refused("colour", "red"));
}

}  // namespace
}  // namespace tunnel_pilot::simulation
