#include "tunnel_pilot/simulation/simulator.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

namespace tunnel_pilot::simulation {
namespace {

const std::string kConfig = TUNNEL_PILOT_SOURCE_DIR "/config/";

// A straight drift 6 m wide and 200 m long, its end closed.
world::World drift() {
  world::World world;
  world.walls = {{{-20.0, 3.0}, {180.0, 3.0}, {180.0, -3.0}, {-20.0, -3.0}}};
  world.design_line = geometry::buildPath({{200.0, 0.0, 0.0}}, {-20.0, 0.0, 0.0}, 0.5);
  world.width = 6.0;
  return world;
}

// A simulator with a kinematic truck, and a participant that listens on its bus.
struct Bench {
  can::MemoryBusHub hub;
  std::unique_ptr<can::Bus> truck_side = hub.connect();
  std::unique_ptr<can::Bus> listener = hub.connect();
  SimulatorParameters parameters = loadSimulator(config::loadFile(kConfig + "simulator.yaml"));
  vehicle::TruckParameters truck = vehicle::loadTruck(kConfig + "truck.yaml");
  Simulator simulator;

  explicit Bench(world::World world = drift(), std::uint64_t seed = 1000)
      : simulator(parameters, loadTruckController(config::loadFile(kConfig + "truck_controller.yaml")),
                  truck, std::make_unique<vehicle::KinematicTruck>(truck), vehicle::Load::kLoaded,
                  std::move(world), seed, *truck_side) {}

  // Rolls straight on at `speed` for `seconds`; returns the scans that came.
  std::vector<geometry::Scan> roll(double speed, double seconds) {
    std::vector<geometry::Scan> scans;
    const Stamp end = simulator.now() + fromSeconds(seconds);
    simulator.lead(vehicle::PlantInput{});
    if (simulator.state().speed != speed) simulator.place(simulator.state().pose, speed);
    while (simulator.now() < end) {
      const Simulator::Events& events = simulator.step();
      if (events.scan != nullptr) scans.push_back(*events.scan);
      if (events.contact) contacts.push_back(*events.contact);
    }
    return scans;
  }

  std::vector<Contact> contacts;
};

bool sameRanges(const geometry::Scan& a, const geometry::Scan& b) {
  for (std::size_t i = 0; i < a.ranges.size(); ++i) {
    const bool both_nan = std::isnan(a.ranges[i]) && std::isnan(b.ranges[i]);
    if (a.ranges[i] != b.ranges[i] && !both_nan) return false;
  }
  return a.ranges.size() == b.ranges.size() && a.stamp == b.stamp;
}

TEST(Simulator, AdvancesByItsFixedStep) {
  Bench bench;
  bench.roll(3.0, 1.0);
  EXPECT_EQ(bench.simulator.now(), std::chrono::seconds(1));
  EXPECT_NEAR(bench.simulator.state().pose.x, 3.0, 1e-9);
}

TEST(Simulator, DeliversThirtyFiveScansASecondFortyMillisecondsLate) {
  Bench bench;
  bench.simulator.lead(vehicle::PlantInput{});
  int scans = 0;
  while (bench.simulator.now() < std::chrono::seconds(10)) {
    const geometry::Scan* scan = bench.simulator.step().scan;
    if (scan == nullptr) continue;
    EXPECT_NEAR(toSeconds(bench.simulator.now() - scan->stamp), 0.040, 0.001);
    EXPECT_NEAR(toSeconds(scan->stamp) * 35.0, scans, 1e-6);
    ++scans;
  }
  EXPECT_NEAR(scans, 350, 2);
}

TEST(Simulator, AScanShowsTheWorldFromWhereTheTruckWasAtItsStamp) {
  Bench bench;
  const auto scans = bench.roll(3.0, 2.0);
  const geometry::Scan& scan = scans.back();
  const double lidar_x = 3.0 * toSeconds(scan.stamp) + bench.truck.geometry.lidar_x;
  // A beam 60 degrees to the left meets the wall 3 m aside, whatever the way; the far end is not in
  // range.
  EXPECT_NEAR(scan.ranges[380 + 240], 3.0 / std::sin(M_PI / 3), 0.08);
  EXPECT_NEAR(bench.simulator.truthOfScan().state.pose.x + bench.truck.geometry.lidar_x, lidar_x, 1e-6);
  EXPECT_EQ(bench.simulator.truthOfScan().stamp, scan.stamp);
}

TEST(Simulator, SameSeedGivesTheSameScansAndFrames) {
  Bench first, second, other(drift(), 1001);
  const auto a = first.roll(3.0, 1.0), b = second.roll(3.0, 1.0), c = other.roll(3.0, 1.0);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(sameRanges(a[i], b[i])) << i;
  EXPECT_FALSE(sameRanges(a.back(), c.back()));
  int frames = 0;
  while (const auto frame = first.listener->receive()) {
    const auto same = second.listener->receive();
    ASSERT_TRUE(same.has_value());
    EXPECT_EQ(frame->id, same->id);
    EXPECT_EQ(frame->data, same->data);
    ++frames;
  }
  EXPECT_GE(frames, 150) << "feedback, motion and status at 50 Hz";
}

TEST(Simulator, TruthTellsOffsetHeadingAndClearanceFromTheDesignLine) {
  Bench bench;
  bench.simulator.place(bench.simulator.poseOnLine(30.0, 0.5, 0.1));
  const Truth& truth = bench.simulator.truth();
  EXPECT_TRUE(truth.on_design_line);
  EXPECT_NEAR(truth.station, 30.0, 1e-9);
  EXPECT_NEAR(truth.lateral_offset, 0.5, 1e-9);
  EXPECT_NEAR(truth.heading_error, 0.1, 1e-9);
  // The front left corner: 1.6 m ahead and 1.525 m left of the axle, turned by 0.1.
  EXPECT_NEAR(truth.clearance, 3.0 - (0.5 + 1.6 * std::sin(0.1) + 1.525 * std::cos(0.1)), 1e-6);
}

TEST(Simulator, StationGrowsOverTheSeamOfAClosedLine) {
  world::World ring;
  ring.design_line = geometry::buildPath({{2 * M_PI * 20.0, 0.05, 0.05}}, {}, 0.2, true);
  Bench bench(ring);
  const double gamma = vehicle::steadyArticulation(bench.truck.geometry, 0.05);
  bench.simulator.place({}, 3.0);
  bench.simulator.lead(vehicle::PlantInput{gamma, 0.0});
  double last = 0.0;
  for (int i = 0; i < 100'000; ++i) {
    if (!bench.simulator.step().truth) continue;
    EXPECT_GT(bench.simulator.truth().station, last - 1e-6);
    EXPECT_LT(bench.simulator.truth().station, last + 0.2);
    last = bench.simulator.truth().station;
  }
  EXPECT_GT(last, 1.9 * 2 * M_PI * 20.0) << "twice round";
}

TEST(Simulator, TellsEachContactOnceWithItsBody) {
  Bench bench;
  bench.simulator.place({170.0, 0.0, 0.0}, 3.0);
  bench.roll(3.0, 5.0);
  ASSERT_EQ(bench.contacts.size(), 2u);
  EXPECT_TRUE(bench.contacts[0].front);
  // The nose is 1.6 m ahead of the front axle, 8.4 m from the wall.
  EXPECT_NEAR(toSeconds(bench.contacts[0].stamp), 8.4 / 3.0, 0.03);
  EXPECT_FALSE(bench.contacts[1].front) << "then the rear body";
  EXPECT_EQ(bench.simulator.truth().contacts, 2u);
}

TEST(Simulator, MovingObstaclesAreSeenWhereTheyAreAndTouched) {
  world::World world = drift();
  world::Obstacle person;
  person.outline = {{-0.3, -0.3}, {0.3, -0.3}, {0.3, 0.3}, {-0.3, 0.3}};
  person.start = {30.0, 0.0, M_PI};
  person.speed = 2.0;
  world.obstacles = {person};
  Bench bench(world);
  const geometry::Scan scan = bench.roll(0.0, 5.0).back();
  const double x = 30.0 - 2.0 * toSeconds(scan.stamp) - 0.3 - bench.truck.geometry.lidar_x;
  EXPECT_NEAR(scan.ranges[380], x, 0.1);
  bench.roll(0.0, 9.5);
  EXPECT_GE(bench.simulator.truth().contacts, 1u);
}

TEST(Simulator, ADeadLidarSendsNothing) {
  Bench bench;
  EXPECT_FALSE(bench.roll(0.0, 0.5).empty());
  bench.simulator.setLidarAlive(false);
  bench.roll(0.0, 0.1);  // what was under way
  EXPECT_TRUE(bench.roll(0.0, 1.0).empty());
  bench.simulator.setLidarAlive(true);
  EXPECT_FALSE(bench.roll(0.0, 0.5).empty());
}

TEST(Simulator, PlacingTheTruckDropsScansFromTheOldPlace) {
  Bench bench;
  bench.roll(0.0, 0.5);
  const Stamp placed = bench.simulator.now();
  bench.simulator.place({100.0, 0.0, 0.0});
  bench.simulator.lead(vehicle::PlantInput{});
  for (int i = 0; i < 500; ++i) {
    const geometry::Scan* scan = bench.simulator.step().scan;
    if (scan != nullptr) {
      EXPECT_GE(scan->stamp, placed - std::chrono::milliseconds(1));
    }
  }
}

TEST(Simulator, WithoutACommandTheTruckStands) {
  Bench bench;
  for (int i = 0; i < 3000; ++i) bench.simulator.step();
  EXPECT_LT(std::abs(bench.simulator.state().pose.x), 0.01);
}

TEST(SimulatorParameters, EveryMissingKeyIsRefused) {
  const YAML::Node good = YAML::LoadFile(kConfig + "simulator.yaml");
  int refused = 0, keys = 0;
  for (const auto& entry : good) {
    YAML::Node bad = YAML::Clone(good);
    bad.remove(entry.first.as<std::string>());
    ++keys;
    try {
      loadSimulator(config::Node(bad, "simulator.yaml"));
    } catch (const config::ConfigError& error) {
      refused +=
          std::string(error.what()).find(entry.first.as<std::string>()) != std::string::npos ? 1 : 0;
    }
  }
  EXPECT_EQ(refused, keys);
  EXPECT_GE(keys, 9);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
