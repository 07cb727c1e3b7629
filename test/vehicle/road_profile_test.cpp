#include "tunnel_pilot/vehicle/road_profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <vector>

namespace tunnel_pilot::vehicle {
namespace {

constexpr double kClassE = 4096e-6;  // G_d(0.1 / m) [m^3]

// One-sided displacement spectrum, averaged over the band [from, to] [1/m]. The road is a closed loop,
// so a plain Fourier sum over it has no leakage. `stride` thins out a band's lines.
double spectrum(const std::vector<double>& z, double period, double from, double to) {
  const int first = static_cast<int>(std::ceil(from * period));
  const int last = static_cast<int>(std::floor(to * period));
  const int stride = std::max(1, (last - first) / 40);
  double sum = 0.0;
  int lines = 0;
  for (int k = first; k <= last; k += stride, ++lines) {
    const std::complex<double> turn = std::polar(1.0, -2.0 * M_PI * k / static_cast<double>(z.size()));
    std::complex<double> phase = 1.0;
    std::complex<double> amplitude = 0.0;
    for (double height : z) {
      amplitude += height * phase;
      phase *= turn;
    }
    sum += 2.0 * period * std::norm(amplitude / static_cast<double>(z.size()));
  }
  return sum / lines;
}

// log10 of G_d against log10 of n in octave bands, averaged over seeds.
struct Band {
  double n;    // geometric middle [1/m]
  double g_d;  // [m^3]
};

std::vector<Band> bands() {
  constexpr int kSeeds = 4;
  std::vector<Band> result;
  for (double n = 0.022; n < 2.0; n *= 2.0) result.push_back({n * std::sqrt(2.0), 0.0});
  for (int seed = 0; seed < kSeeds; ++seed) {
    const RoadProfile road(kClassE, 100u + seed);
    std::vector<double> z(32768);
    for (std::size_t i = 0; i < z.size(); ++i) {
      z[i] = road.elevation(road.period() * static_cast<double>(i) / static_cast<double>(z.size()));
    }
    for (Band& band : result) {
      band.g_d += spectrum(z, road.period(), band.n / std::sqrt(2.0), band.n * std::sqrt(2.0)) / kSeeds;
    }
  }
  return result;
}

TEST(RoadProfile, SpectrumLiesWithinTheLimitsOfClassE) {
  for (const Band& band : bands()) {
    // A band's mean of n^-2 is that at its geometric middle.
    const double at_reference = band.g_d * std::pow(band.n / 0.1, 2);
    EXPECT_GT(at_reference, 2048e-6) << band.n;
    EXPECT_LT(at_reference, 8192e-6) << band.n;
  }
}

TEST(RoadProfile, SpectrumFallsWithSlopeMinusTwo) {
  const std::vector<Band> all = bands();
  double mean_x = 0.0;
  double mean_y = 0.0;
  for (const Band& b : all) {
    mean_x += std::log10(b.n) / static_cast<double>(all.size());
    mean_y += std::log10(b.g_d) / static_cast<double>(all.size());
  }
  double xy = 0.0;
  double xx = 0.0;
  for (const Band& b : all) {
    xy += (std::log10(b.n) - mean_x) * (std::log10(b.g_d) - mean_y);
    xx += std::pow(std::log10(b.n) - mean_x, 2);
  }
  EXPECT_NEAR(xy / xx, -2.0, 0.1);
  RecordProperty("slope", std::to_string(xy / xx));
  RecordProperty("g_d_at_reference_m3",
                 std::to_string(std::pow(10.0, mean_y - (xy / xx) * (mean_x + 1.0))));
}

TEST(RoadProfile, SameSeedSameRoadOtherSeedOtherRoad) {
  const RoadProfile a(kClassE, 7);
  const RoadProfile b(kClassE, 7);
  const RoadProfile c(kClassE, 8);
  EXPECT_EQ(a.elevation(123.4), b.elevation(123.4));
  EXPECT_NE(a.elevation(123.4), c.elevation(123.4));
}

TEST(RoadProfile, IsALoopInBothDirections) {
  const RoadProfile road(kClassE, 7);
  EXPECT_NEAR(road.elevation(5.0), road.elevation(5.0 + road.period()), 1e-9);
  EXPECT_NEAR(road.elevation(-5.0), road.elevation(road.period() - 5.0), 1e-9);
  EXPECT_NEAR(road.elevation(-1e-18), road.elevation(0.0), 1e-9);
}

TEST(RoadProfile, FootprintMeanIsTheAverageOfTheHeights) {
  const RoadProfile road(kClassE, 7);
  for (const double s : {3.21, 0.1, road.period() - 0.05, -0.1}) {
    double sum = 0.0;
    constexpr int kSamples = 4000;
    for (int i = 0; i < kSamples; ++i) sum += road.elevation(s - 0.2 + 0.4 * (i + 0.5) / kSamples);
    EXPECT_NEAR(road.mean(s, 0.4), sum / kSamples, 1e-6) << s;
  }
}

TEST(RoadProfile, NoRoughnessIsAPlane) {
  const RoadProfile road(0.0, 7);
  EXPECT_EQ(road.elevation(17.0), 0.0);
  EXPECT_EQ(road.mean(17.0, 0.4), 0.0);
}

}  // namespace
}  // namespace tunnel_pilot::vehicle
