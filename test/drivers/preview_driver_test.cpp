#include "tunnel_pilot/drivers/preview_driver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tunnel_pilot::drivers {
namespace {

const std::string kConfig = std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

PreviewDriverParameters parameters() {
  return loadPreviewDriver(config::loadFile(kConfig + "preview_driver.yaml"), kConfig);
}

PreviewDriver driver() { return {parameters(), vehicle::loadTruck(kConfig + "truck.yaml").geometry}; }

perception::Tunnel tunnelAt(double time, double offset = 0.0) {
  perception::Tunnel tunnel;
  tunnel.state.stamp = fromSeconds(time);
  tunnel.state.valid = true;
  tunnel.state.lateral_offset = offset;
  tunnel.centerline = geometry::buildPath({{20.0, 0.0, 0.0}}, {-1.0, -offset, 0.0}, 0.5);
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

TEST(PreviewDriver, CarriesTheScansStampAndAPreviewPointOnTheCenterline) {
  const Proposal proposal = driver().propose(tunnelAt(1.0, 0.5), motionAt(1.03), fromSeconds(1.05));
  ASSERT_TRUE(proposal.valid);
  EXPECT_EQ(proposal.stamp, fromSeconds(1.0));
  ASSERT_TRUE(proposal.preview_point);
  EXPECT_NEAR(proposal.preview_point->y(), -0.5, 1e-9);
  EXPECT_NEAR(proposal.preview_point->x(), 3.0 * parameters().preview_time, 1e-6);
}

TEST(PreviewDriver, AsksForItsConfiguredSpeed) {
  EXPECT_DOUBLE_EQ(driver().propose(tunnelAt(1.0), motionAt(1.03), fromSeconds(1.05)).speed,
                   parameters().speed);
}

TEST(PreviewDriver, MeasuredUncertaintyLowersItsConfidence) {
  perception::Tunnel sure = tunnelAt(1.0);
  perception::Tunnel unsure = tunnelAt(1.0);
  unsure.state.covariance[0] = 0.04;
  EXPECT_GT(driver().propose(sure, motionAt(1.03), fromSeconds(1.05)).confidence,
            driver().propose(unsure, motionAt(1.03), fromSeconds(1.05)).confidence);
}

TEST(PreviewDriver, ProposesNothingWithoutAValidTunnel) {
  perception::Tunnel tunnel = tunnelAt(1.0);
  tunnel.state.valid = false;
  EXPECT_FALSE(driver().propose(tunnel, motionAt(1.03), fromSeconds(1.05)).valid);
  EXPECT_FALSE(driver().propose(perception::Tunnel(), motionAt(1.03), fromSeconds(1.05)).valid);
}

TEST(PreviewDriver, ProposesNothingOnAnOldTunnel) {
  const double age = parameters().truck.max_tunnel_age;
  EXPECT_TRUE(driver().propose(tunnelAt(1.0), motionAt(1.0 + age), fromSeconds(1.0 + age)).valid);
  EXPECT_FALSE(driver().propose(tunnelAt(1.0), motionAt(1.0 + age), fromSeconds(1.001 + age)).valid);
}

TEST(PreviewDriver, ProposesNothingFromNumbersThatAreNone) {
  perception::Tunnel tunnel = tunnelAt(1.0);
  tunnel.state.heading_error = kNaN;
  EXPECT_FALSE(driver().propose(tunnel, motionAt(1.03), fromSeconds(1.05)).valid);
  Motion motion = motionAt(1.03);
  motion.speed = kNaN;
  EXPECT_FALSE(driver().propose(tunnelAt(1.0), motion, fromSeconds(1.05)).valid);
}

TEST(PreviewDriver, MotionFromTheFutureStopsOneProposalOnly) {
  PreviewDriver preview = driver();
  EXPECT_FALSE(preview.propose(tunnelAt(1.0), motionAt(1e5), fromSeconds(1.05)).valid);
  const Proposal after = preview.propose(tunnelAt(1.03, 0.5), motionAt(1.06), fromSeconds(1.08));
  ASSERT_TRUE(after.valid);
  EXPECT_EQ(after.articulation_angle,
            driver().propose(tunnelAt(1.03, 0.5), motionAt(1.06), fromSeconds(1.08)).articulation_angle);
}

TEST(PreviewDriver, SteersATruckWithoutAnyDelayToo) {
  PreviewDriverParameters p = parameters();
  p.truck.steering.dead_time = 0.0;
  p.truck.steering.transport_delay = 0.0;
  PreviewDriver d(p, vehicle::loadTruck(kConfig + "truck.yaml").geometry);
  const Proposal proposal = d.propose(tunnelAt(1.0, 0.5), motionAt(1.0), fromSeconds(1.0));
  EXPECT_TRUE(std::isfinite(proposal.articulation_angle));
}

TEST(PreviewDriver, StartsFromTheMeasuredArticulation) {
  const Proposal proposal = driver().propose(tunnelAt(1.0), motionAt(1.03, 0.2), fromSeconds(1.05));
  EXPECT_NEAR(proposal.articulation_angle, 0.2, 1e-9);
}

TEST(PreviewDriver, ItsCommandNeverMovesFasterThanTheSteering) {
  PreviewDriver d = driver();
  double last = 0.0;
  for (int i = 0; i < 100; ++i) {
    const double time = 1.0 + 0.03 * i;
    const double offset = i < 50 ? 1.5 : -1.5;  // a jump of the path itself
    const Proposal proposal =
        d.propose(tunnelAt(time, offset), motionAt(time + 0.03, last), fromSeconds(time + 0.05));
    ASSERT_TRUE(proposal.valid);
    if (i > 0) {
      EXPECT_LE(
          std::abs(proposal.articulation_angle - last),
          parameters().truck.steering.max_rate * 0.03 + parameters().truck.steering.dead_band + 1e-9);
    }
    last = proposal.articulation_angle;
  }
}

TEST(PreviewDriver, StaysNearTheArticulationWhileSomeoneElseSteers) {
  PreviewDriver d = driver();
  for (int i = 0; i < 200; ++i) {
    const double time = 1.0 + 0.03 * i;
    const Proposal proposal =
        d.propose(tunnelAt(time, 1.0), motionAt(time + 0.03, 0.3), fromSeconds(time + 0.05));
    EXPECT_NEAR(proposal.articulation_angle, 0.3,
                2.0 * parameters().truck.steering.lead + parameters().truck.steering.max_bias +
                    parameters().truck.steering.dead_band);
  }
}

TEST(PreviewDriver, AnOldScanAndAFreshOneOfTheSamePathSteerAlike) {
  // The truck drives along x; the path crosses its way at an angle. What a scan saw is brought to now.
  const auto seenAt = [](double time) {
    const geometry::Pose truck{3.0 * time, 0.0, 0.0};
    const geometry::Path path = geometry::buildPath({{60.0, 0.0, 0.0}}, {-5.0, 0.5, -0.05}, 0.5);
    const geometry::PathProjection foot = path.project(truck.position());
    perception::Tunnel tunnel = tunnelAt(time);
    tunnel.state.lateral_offset = foot.lateral_offset;
    tunnel.state.heading_error = -foot.heading;
    tunnel.centerline = geometry::buildPath({{60.0, 0.0, 0.0}}, truck.relative({-5.0, 0.5, -0.05}), 0.5);
    return tunnel;
  };
  const auto steers = [&](double latency) {
    PreviewDriver d = driver();
    double angle = 0.0;
    for (int i = 0; i < 10; ++i) {
      const double now = 1.0 + 0.03 * i;
      angle = d.propose(seenAt(now - latency), motionAt(now), fromSeconds(now)).articulation_angle;
    }
    return angle;
  };
  EXPECT_GT(std::abs(steers(0.0)), 0.01);
  EXPECT_NEAR(steers(0.2), steers(0.0), 1e-3);
}

TEST(PreviewDriver, ForgetsEverythingOnReset) {
  PreviewDriver fresh = driver();
  PreviewDriver used = driver();
  for (int i = 0; i < 50; ++i) {
    const double time = 1.0 + 0.03 * i;
    used.propose(tunnelAt(time, 0.7), motionAt(time + 0.03, 0.1), fromSeconds(time + 0.05));
  }
  used.reset();
  const auto answer = [](PreviewDriver& d) {
    double angle = 0.0;
    for (int i = 0; i < 5; ++i) {
      const double time = 0.5 + 0.03 * i;
      angle = d.propose(tunnelAt(time, 0.2), motionAt(time + 0.03), fromSeconds(time + 0.05))
                  .articulation_angle;
    }
    return angle;
  };
  EXPECT_EQ(answer(used), answer(fresh));
}

TEST(PreviewDriverParameters, OutOfRangeIsRefusedByName) {
  YAML::Node yaml = YAML::LoadFile(kConfig + "preview_driver.yaml");
  yaml["steering"]["dead_time"] = -0.1;
  try {
    loadPreviewDriver(config::Node(yaml, "preview_driver.yaml"), kConfig);
    FAIL() << "not refused";
  } catch (const config::ConfigError& e) {
    EXPECT_NE(std::string(e.what()).find("steering.dead_time"), std::string::npos) << e.what();
  }
}

TEST(PreviewDriverParameters, UnknownKeyIsRefused) {
  YAML::Node yaml = YAML::LoadFile(kConfig + "preview_driver.yaml");
  yaml["sped"] = 3.0;
  EXPECT_THROW(loadPreviewDriver(config::Node(yaml, "preview_driver.yaml"), kConfig),
               config::ConfigError);
}

}  // namespace
}  // namespace tunnel_pilot::drivers
