#include "tunnel_pilot/drivers/neural_preview_driver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "sensed_path_drive.h"
#include "tunnel_pilot/drivers/preview_laws.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"

namespace tunnel_pilot::drivers {
namespace {

const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

PreviewDriverParameters parameters() {
  return loadPreviewDriver(config::loadFile(kConfig + "preview_driver.yaml"), kConfig,
                           PreviewLaw::kNetwork);
}

vehicle::TruckParameters truck() { return vehicle::loadTruck(kConfig + "truck.yaml"); }

NeuralPreviewDriver driver() { return {parameters(), truck().geometry}; }

perception::Tunnel tunnelAt(double time, double offset = 0.0, double curvature = 0.0) {
  perception::Tunnel tunnel;
  tunnel.state.stamp = fromSeconds(time);
  tunnel.state.valid = true;
  tunnel.state.lateral_offset = offset;
  tunnel.state.curvature = curvature;
  tunnel.centerline = geometry::buildPath({{20.0, curvature, curvature}}, {0.0, -offset, 0.0}, 0.25);
  return tunnel;
}

Motion motionAt(double time, double articulation = 0.0) {
  Motion motion;
  motion.stamp = fromSeconds(time);
  motion.pose = {3.0 * time, 0.0, 0.0};
  motion.speed = 3.0;
  motion.articulation = articulation;
  return motion;
}

// The command after some scans of the same standing picture.
double settled(NeuralPreviewDriver& d, double offset, double curvature, double articulation) {
  double angle = 0.0;
  for (int i = 0; i < 15; ++i) {
    const double time = 1.0 + 0.03 * i;
    Motion motion = motionAt(1.0, articulation);
    motion.stamp = fromSeconds(time);
    angle = d.propose(tunnelAt(time, offset, curvature), motion, fromSeconds(time)).articulation_angle;
  }
  return angle;
}

// 10 m aside in a half-cosine of 24 m, after 30 m straight, at 15 km/h: loaded, class E, sensed with
// noise.
SensedPathDrive::Result laneChange(const PreviewDriverParameters& p, double duration = 20.0) {
  const auto y = [](double x) {
    return 5.0 * (1.0 - std::cos(M_PI * std::clamp((x - 30.0) / 24.0, 0.0, 1.0)));
  };
  std::vector<geometry::PathPoint> points;
  double s = 0.0;
  for (double x = 0.0; x < 30.0 + 5.0 * duration; x += 0.1) {
    const double d = 1e-3;
    const double slope = (y(x + d) - y(x - d)) / (2.0 * d);
    const double bend = (y(x + d) - 2.0 * y(x) + y(x - d)) / (d * d);
    if (!points.empty()) s += std::hypot(0.1, y(x) - points.back().y);
    points.push_back({s, x, y(x), std::atan(slope), bend / std::pow(1.0 + slope * slope, 1.5)});
  }
  SensedPathDrive setup;
  setup.path = geometry::Path(points);
  setup.start = {5.0, 0.0, 0.0};
  setup.speed = NeuralPreviewDriver::kNetworkSpeed;
  setup.duration = duration;
  setup.sight = 40.0;
  vehicle::DynamicTruckOptions options;
  options.road_seed = setup.seed;
  vehicle::DynamicTruck plant(truck(), options);
  NeuralPreviewDriver driver(p, truck().geometry);
  return setup.run(plant, driver);
}

TEST(RoadPreview, IsThePlaceAfterThePreviewOnAnArc) {
  const geometry::Path arc = geometry::buildPath({{30.0, 0.05, 0.05}}, {}, 0.25);
  EXPECT_NEAR(roadPreview(arc, 2.0, 6.0), 0.5 * 0.05 * 36.0, 1e-9);
}

TEST(RoadPreview, IsTheWeightedMeanOfThePathOverThePreview) {
  // A bend that begins after h: (5 / T^3) int tau^2 f = k (5 / D^3) int_h^D s^2 (s - h)^2 / 2 ds.
  const double k = 0.08;
  const double h = 2.0;
  const double d = 5.0;
  const geometry::Path path = geometry::buildPath({{10.0 + h, 0.0, 0.0}, {20.0, k, k}}, {}, 0.05);
  const auto integral = [&](double s) {
    return s * s * s * s * s / 5.0 - 2.0 * h * s * s * s * s / 4.0 + h * h * s * s * s / 3.0;
  };
  const double exact = 0.5 * k * 5.0 / (d * d * d) * (integral(d) - integral(h));
  EXPECT_NEAR(roadPreview(path, 10.0, d), exact, 0.02 * exact);
}

TEST(NeuralPreviewDriver, CarriesTheScansStampAndAPreviewPointOnTheCenterline) {
  const Proposal proposal = driver().propose(tunnelAt(1.0, 0.5), motionAt(1.03), fromSeconds(1.05));
  ASSERT_TRUE(proposal.valid);
  EXPECT_EQ(proposal.stamp, fromSeconds(1.0));
  EXPECT_DOUBLE_EQ(proposal.speed, parameters().speed);
  ASSERT_TRUE(proposal.preview_point);
  EXPECT_NEAR(proposal.preview_point->y(), -0.5, 1e-9);
}

TEST(NeuralPreviewDriver, ProposesNothingWithoutAValidAndFreshTunnel) {
  perception::Tunnel tunnel = tunnelAt(1.0);
  tunnel.state.valid = false;
  EXPECT_FALSE(driver().propose(tunnel, motionAt(1.03), fromSeconds(1.05)).valid);
  EXPECT_FALSE(driver().propose(perception::Tunnel(), motionAt(1.03), fromSeconds(1.05)).valid);
  const double late = 1.001 + parameters().truck.max_tunnel_age;
  EXPECT_FALSE(driver().propose(tunnelAt(1.0), motionAt(late), fromSeconds(late)).valid);
}

TEST(NeuralPreviewDriver, ProposesNothingFromNumbersThatAreNone) {
  perception::Tunnel tunnel = tunnelAt(1.0);
  tunnel.state.lateral_offset = kNaN;
  EXPECT_FALSE(driver().propose(tunnel, motionAt(1.03), fromSeconds(1.05)).valid);
  Motion motion = motionAt(1.03);
  motion.articulation = kNaN;
  EXPECT_FALSE(driver().propose(tunnelAt(1.0), motion, fromSeconds(1.05)).valid);
}

TEST(NeuralPreviewDriver, SteersRightFromTheLeftOfThePathAndTheOtherWayRound) {
  NeuralPreviewDriver left = driver();
  NeuralPreviewDriver right = driver();
  EXPECT_LT(settled(left, 0.3, 0.0, 0.0), -0.02);
  EXPECT_GT(settled(right, -0.3, 0.0, 0.0), 0.02);
}

TEST(NeuralPreviewDriver, ASlowTruckIsSteeredAsAtTheLeastPace) {
  const auto asked = [](double least_pace) {
    PreviewDriverParameters p = parameters();
    p.network_law.least_pace = least_pace;
    NeuralPreviewDriver d(p, truck().geometry);
    const Proposal proposal = d.propose(tunnelAt(1.0, 0.3), motionAt(1.0), fromSeconds(1.0));
    return std::make_pair(proposal.preview_point->x(), settled(d, 0.3, 0.0, 0.0));
  };
  const auto [far, calm] = asked(4.0);  // the truck drives 3 m/s
  const auto [near, hasty] = asked(2.0);
  EXPECT_NEAR(far - near, parameters().preview_time * (4.0 - 3.0), 0.01);
  EXPECT_LT(std::abs(calm), 0.9 * std::abs(hasty));
}

TEST(NeuralPreviewDriver, StartsFromTheMeasuredArticulation) {
  const Proposal proposal = driver().propose(tunnelAt(1.0), motionAt(1.03, 0.2), fromSeconds(1.05));
  EXPECT_NEAR(proposal.articulation_angle, 0.2, 1e-9);
}

TEST(NeuralPreviewDriver, ItsCommandNeverMovesFasterThanTheSteering) {
  NeuralPreviewDriver d = driver();
  double last = 0.0;
  for (int i = 0; i < 100; ++i) {
    const double time = 1.0 + 0.03 * i;
    const double offset = i < 50 ? 1.5 : -1.5;  // a jump of the path itself
    const Proposal proposal =
        d.propose(tunnelAt(time, offset), motionAt(time + 0.03, last), fromSeconds(time + 0.05));
    ASSERT_TRUE(proposal.valid);
    const SteeringEstimatorParameters steering = parameters().truck.steering;
    if (i > 0) {
      EXPECT_LE(std::abs(proposal.articulation_angle - last),
                steering.max_rate * 0.03 + steering.dead_band + 1e-9);
    }
    last = proposal.articulation_angle;
  }
}

TEST(NeuralPreviewDriver, ForgetsEverythingOnReset) {
  PreviewDriverParameters p = parameters();
  p.network_law.adaptation.enabled = true;
  NeuralPreviewDriver fresh(p, truck().geometry);
  NeuralPreviewDriver used(p, truck().geometry);
  settled(used, 0.7, 0.02, 0.1);
  used.reset();
  EXPECT_EQ(settled(used, 0.2, 0.0, 0.0), settled(fresh, 0.2, 0.0, 0.0));
}

TEST(NeuralPreviewDriver, RefusesToBeWithoutANetwork) {
  PreviewDriverParameters p = parameters();
  p.network.reset();
  EXPECT_THROW(NeuralPreviewDriver(p, truck().geometry), config::ConfigError);
}

TEST(NeuralPreviewDriver, DrivesALaneChange) { EXPECT_LT(laneChange(parameters()).max, 0.13); }

TEST(NeuralPreviewDriver, KnowsOfTheSteeringsDelays) {
  // Without the dead time in its prediction, the same law weaves.
  PreviewDriverParameters ignorant = parameters();
  ignorant.truck.steering.dead_time = 0.0;
  ignorant.truck.steering.transport_delay = 0.0;
  EXPECT_GT(laneChange(ignorant).rms, 1.5 * laneChange(parameters()).rms);
}

TEST(NeuralPreviewDriver, MakesUpForTheSteeringsLag) {
  PreviewDriverParameters slow = parameters();
  slow.network_law.correction_time = 0.08;  // commands a third of what the lag needs
  EXPECT_GT(laneChange(slow).rms, 1.5 * laneChange(parameters()).rms);
}

TEST(NeuralPreviewDriver, LearningOverALongNoisyDriveDoesLittleHarm) {
  PreviewDriverParameters p = parameters();
  p.network_law.adaptation.enabled = true;
  const double learning = laneChange(p, 120.0).rms;
  p.network_law.adaptation.enabled = false;
  EXPECT_LT(learning, 1.25 * laneChange(p, 120.0).rms);
}

TEST(PreviewLaw, TheFileChoosesTheDriverAndACallerMayChooseAnother) {
  const auto drives = [](std::optional<PreviewLaw> law) {
    const auto p = loadPreviewDriver(config::loadFile(kConfig + "preview_driver.yaml"), kConfig, law);
    const auto made = makePreviewDriver(p, truck().geometry);
    return dynamic_cast<const NeuralPreviewDriver*>(made.get()) != nullptr;
  };
  EXPECT_FALSE(drives(std::nullopt));
  EXPECT_FALSE(drives(PreviewLaw::kOptimal));
  EXPECT_TRUE(drives(PreviewLaw::kNetwork));
}

TEST(PreviewLaw, ANetworkThatIsNotThereIsRefusedOnlyIfItIsToDrive) {
  YAML::Node yaml = YAML::LoadFile(kConfig + "preview_driver.yaml");
  yaml["network"]["file"] = "../networks/none.yaml";
  const config::Node node(yaml, "preview_driver.yaml");
  EXPECT_NO_THROW(loadPreviewDriver(node, kConfig, PreviewLaw::kOptimal));
  EXPECT_THROW(loadPreviewDriver(node, kConfig, PreviewLaw::kNetwork), config::ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
