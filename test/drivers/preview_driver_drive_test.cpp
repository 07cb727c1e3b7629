#include <gtest/gtest.h>

#include "sensed_path_drive.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"
#include "tunnel_pilot/vehicle/truck_variation.h"

namespace tunnel_pilot::drivers {
namespace {

const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";

vehicle::TruckParameters truck() { return vehicle::loadTruck(kConfig + "truck.yaml"); }

// Loaded, class E road. The driver never learns of `plant_truck`.
SensedPathDrive::Result drive(const SensedPathDrive& setup,
                              const vehicle::TruckParameters& plant_truck) {
  vehicle::DynamicTruckOptions options;
  options.road_seed = setup.seed;
  vehicle::DynamicTruck plant(plant_truck, options);
  PreviewDriver driver(loadPreviewDriver(config::loadFile(kConfig + "preview_driver.yaml"), kConfig),
                       truck().geometry);
  return setup.run(plant, driver);
}

// One half-cosine of 10 m within 24 m after 30 m straight, sampled along its length.
SensedPathDrive singleLaneChange() {
  const auto y = [](double x) {
    return 5.0 * (1.0 - std::cos(M_PI * std::clamp((x - 30.0) / 24.0, 0.0, 1.0)));
  };
  std::vector<geometry::PathPoint> points;
  double s = 0.0;
  for (double x = 0.0; x < 110.0; x += 0.1) {
    const double d = 1e-3;
    const double slope = (y(x + d) - y(x - d)) / (2.0 * d);
    const double bend = (y(x + d) - 2.0 * y(x) + y(x - d)) / (d * d);
    if (!points.empty()) s += std::hypot(0.1, y(x) - points.back().y);
    points.push_back({s, x, y(x), std::atan(slope), bend / std::pow(1.0 + slope * slope, 1.5)});
  }
  SensedPathDrive setup;
  setup.path = geometry::Path(points);
  setup.start = {5.0, 0.0, 0.0};
  setup.speed = 15.0 / 3.6;
  setup.duration = 20.0;
  setup.sight = 40.0;
  return setup;
}

SensedPathDrive returnFrom(double offset, double heading) {
  SensedPathDrive setup;
  setup.path = geometry::buildPath({{80.0, 0.0, 0.0}}, {}, 0.25);
  setup.start = {5.0, offset, heading};
  setup.speed = 2.0;
  setup.duration = 15.0;
  setup.sight = 20.0;
  return setup;
}

SensedPathDrive reversedBend() {
  const double k = 1.0 / 12.0;
  SensedPathDrive setup;
  setup.path = geometry::buildPath({{15.0, 0.0, 0.0},
                                    {8.0, 0.0, k},
                                    {12.0, k, k},
                                    {13.0, k, -k},
                                    {12.0, -k, -k},
                                    {8.0, -k, 0.0},
                                    {30.0, 0.0, 0.0}},
                                   {}, 0.25);
  setup.start = {3.0, 0.0, 0.0};
  setup.duration = 27.0;
  return setup;
}

TEST(PreviewDriverDrive, LaneChangeOfThePaperStaysWithinTenCentimetres) {
  for (const double bias : {-0.00524, 0.00524}) {
    SensedPathDrive setup = singleLaneChange();
    setup.articulation_bias = bias;
    EXPECT_LE(drive(setup, truck()).max, 0.10) << "bias " << bias;
  }
}

TEST(PreviewDriverDrive, LaneChangeStaysWithinTwentyCentimetresWithAnotherTruck) {
  for (const std::uint32_t seed : {1001u, 1002u, 1003u}) {
    SensedPathDrive setup = singleLaneChange();
    setup.seed = seed;
    EXPECT_LE(drive(setup, vehicle::varied(truck(), seed, 0.2)).max, 0.20) << "seed " << seed;
  }
}

TEST(PreviewDriverDrive, ReversalOfTwelveMetreBendsStaysWithinTenCentimetres) {
  const SensedPathDrive::Result result = drive(reversedBend(), truck());
  EXPECT_LE(result.max, 0.10);
  EXPECT_LE(result.rms, 0.04);
}

TEST(PreviewDriverDrive, ReturnsToTheCentreInTime) {
  const SensedPathDrive::Result result = drive(returnFrom(-0.737, -0.3665), truck());
  EXPECT_LE(result.heading_zero, 2.1);
  EXPECT_LE(result.settled, 6.0);
  EXPECT_LE(result.overshoot, 0.05);
}

TEST(PreviewDriverDrive, LearnsTheArticulationSensorsBias) {
  SensedPathDrive setup;
  setup.path = geometry::buildPath({{120.0, 0.0, 0.0}}, {}, 0.5);
  setup.start = {5.0, 0.0, 0.0};
  setup.duration = 20.0;
  setup.offset_noise = setup.heading_noise = 0.0;
  setup.articulation_bias = 0.0;
  const double without = drive(setup, truck()).rms;
  setup.articulation_bias = 0.00524;
  EXPECT_LE(drive(setup, truck()).rms, without + 0.01);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
