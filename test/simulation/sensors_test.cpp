#include "tunnel_pilot/simulation/sensors.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kDegree = 0.017453292519943295;

TEST(ArticulationSensor, HasATenthOfADegreeNoiseRoundItsUnitsBias) {
  const SensorParameters parameters{0.1 * kDegree, 0.3 * kDegree, 0.0, 0.0};
  Sensor sensor(parameters, 1000, Stream::kArticulation);
  double sum = 0.0, squares = 0.0;
  const int count = 100'000;
  for (int i = 0; i < count; ++i) {
    const double error = sensor.measure(0.2, 0.01) - 0.2;
    sum += error;
    squares += error * error;
  }
  const double mean = sum / count;
  EXPECT_NEAR(mean, sensor.bias(), 4 * 0.1 * kDegree / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count - mean * mean), 0.1 * kDegree, 0.001 * kDegree);
}

TEST(Sensor, BiasesOfManyUnitsFillTheirRangeOnBothSides) {
  const SensorParameters parameters{0.0, 0.3, 0.0, 0.0};
  double low = 0.0, high = 0.0, sum = 0.0;
  for (std::uint64_t seed = 1000; seed < 3000; ++seed) {
    const double bias = Sensor(parameters, seed, Stream::kArticulation).bias();
    low = std::min(low, bias);
    high = std::max(high, bias);
    sum += bias;
  }
  EXPECT_NEAR(low, -0.3, 0.005);
  EXPECT_NEAR(high, 0.3, 0.005);
  EXPECT_NEAR(sum / 2000, 0.0, 0.02);
}

TEST(SpeedSensor, IsWrongByItsUnitsScale) {
  const SensorParameters parameters{0.0, 0.0, 0.01, 0.0};
  double largest = 0.0;
  for (std::uint64_t seed = 1000; seed < 2000; ++seed) {
    Sensor sensor(parameters, seed, Stream::kSpeed);
    const double share = sensor.measure(5.0, 0.01) / 5.0 - 1.0;
    EXPECT_LE(std::abs(share), 0.01);
    largest = std::max(largest, std::abs(share));
  }
  EXPECT_GT(largest, 0.0095);
}

TEST(Gyro, DriftGrowsWithTheRootOfTime) {
  const SensorParameters parameters{0.0, 0.0, 0.0, 2e-5};
  double squares = 0.0;
  const int units = 400;
  for (std::uint64_t seed = 1000; seed < 1000 + units; ++seed) {
    Sensor sensor(parameters, seed, Stream::kGyro);
    for (int i = 0; i < 10'000; ++i) sensor.measure(0.0, 0.01);
    squares += sensor.bias() * sensor.bias();
  }
  EXPECT_NEAR(std::sqrt(squares / units), 2e-5 * std::sqrt(100.0), 0.15 * 2e-4);
}

TEST(Sensor, SameSeedGivesTheSameReadings) {
  const SensorParameters parameters{0.1, 0.3, 0.01, 0.001};
  Sensor first(parameters, 5, Stream::kGyro), second(parameters, 5, Stream::kGyro);
  Sensor other(parameters, 6, Stream::kGyro);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(first.measure(1.0, 0.01), second.measure(1.0, 0.01));
  EXPECT_NE(first.measure(1.0, 0.01), other.measure(1.0, 0.01));
}

}  // namespace
}  // namespace tunnel_pilot::simulation
