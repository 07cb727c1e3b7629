// A step of the simulator (truck, exact scan of 761 beams, noise) beside one made of Box2D and the
// standard library's normal distribution; and the closed loop against real time.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "harness.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

#ifdef HAVE_BOX2D
#include <box2d/box2d.h>
#endif

namespace {

using namespace tunnel_pilot;
using benchmark::Contest;
using geometry::Pose;
using world::WallChain;

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;
constexpr double kStep = 0.01;      // [s]
constexpr double kSpeed = 3.0;      // [m/s]
constexpr int kStepsPerPlace = 60;  // then the truck is put to the next place
constexpr std::uint64_t kSeed = 1000;

// A winding drift 5 m wide of 400 wall segments, and places along its middle.
struct Drift {
  std::vector<WallChain> walls{2};
  std::vector<Pose> places;
};

Drift makeDrift() {
  Drift drift;
  Pose pose;
  for (int i = 0; i <= 200; ++i) {
    const double s = 0.5 * i;
    pose.heading = 0.7 * std::sin(s / 12.0);
    drift.walls[0].push_back(pose.transform({0.0, 2.5 + 0.07 * std::sin(1.7 * s)}));
    drift.walls[1].push_back(pose.transform({0.0, -2.5 - 0.07 * std::sin(1.3 * s + 1.0)}));
    if (i > 50 && i < 150 && i % 3 == 0) drift.places.push_back(pose);
    pose = pose.compose({0.5, 0.0, 0.0});
  }
  return drift;
}

// Kinematic truck, ray caster and lidar with all its errors, as the product's simulator puts them
// together.
class OurCore {
 public:
  explicit OurCore(const Drift& drift)
      : drift_(drift),
        parameters_(simulation::loadSimulator(config::loadFile(kPackage + "/config/simulator.yaml"))),
        truck_parameters_(vehicle::loadTruck(kPackage + "/config/truck.yaml")),
        truck_(truck_parameters_),
        caster_(drift.walls, simulation::LidarModel::beams(parameters_.lidar)),
        lidar_(parameters_.lidar, kSeed),
        sensor_{truck_parameters_.geometry.lidar_x, 0.0, 0.0} {}

  float step() {
    if (steps_ % kStepsPerPlace == 0) {
      truck_.reset(drift_.places[steps_ / kStepsPerPlace % drift_.places.size()], 0.0, kSpeed);
    }
    const Pose before = truck_.state().pose;
    truck_.step({0.05, 0.0}, {}, kStep);
    const geometry::Scan& scan = lidar_.sweep(
        caster_, before.compose(sensor_), truck_.state().pose.compose(sensor_),
        truck_parameters_.geometry.lidar_z, 0.0, fromSeconds(kStep * static_cast<double>(steps_)));
    ++steps_;
    return scan.ranges[380];
  }

 private:
  const Drift& drift_;
  simulation::SimulatorParameters parameters_;
  vehicle::TruckParameters truck_parameters_;
  vehicle::KinematicTruck truck_;
  world::RayCaster caster_;
  simulation::LidarModel lidar_;
  Pose sensor_;
  std::size_t steps_ = 0;
};

#ifdef HAVE_BOX2D
// The same with Box2D: walls as edges, the truck a kinematic body, one ray cast a beam, normal noise.
class Box2dCore {
 public:
  explicit Box2dCore(const Drift& drift) : drift_(drift), world_(b2Vec2(0.0F, 0.0F)) {
    b2BodyDef ground_definition;
    b2Body* ground = world_.CreateBody(&ground_definition);
    for (const WallChain& chain : drift.walls) {
      for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
        b2EdgeShape edge;
        edge.SetTwoSided(toBox2d(chain[i]), toBox2d(chain[i + 1]));
        ground->CreateFixture(&edge, 0.0F);
      }
    }
    b2BodyDef definition;
    definition.type = b2_kinematicBody;
    truck_ = world_.CreateBody(&definition);
  }

  float step() {
    if (steps_ % kStepsPerPlace == 0) {
      const Pose& place = drift_.places[steps_ / kStepsPerPlace % drift_.places.size()];
      truck_->SetTransform(toBox2d(place.position()), static_cast<float>(place.heading));
    }
    const float heading = truck_->GetAngle();
    truck_->SetLinearVelocity(static_cast<float>(kSpeed) * b2Vec2(std::cos(heading), std::sin(heading)));
    truck_->SetAngularVelocity(0.03F);
    world_.Step(static_cast<float>(kStep), 8, 3);
    ++steps_;
    return scan();
  }

 private:
  struct Nearest : b2RayCastCallback {
    float ReportFixture(b2Fixture*, const b2Vec2&, const b2Vec2&, float at) override {
      fraction = at;
      return at;
    }
    float fraction = 2.0F;
  };
  static b2Vec2 toBox2d(const geometry::Point& p) {
    return {static_cast<float>(p.x()), static_cast<float>(p.y())};
  }

  float scan() {
    const float reach = 40.0F;
    const b2Vec2 from = truck_->GetWorldPoint(b2Vec2(1.6F, 0.0F));
    for (int i = 0; i < 761; ++i) {
      const float angle = truck_->GetAngle() + static_cast<float>((-95.0 + 0.25 * i) * M_PI / 180.0);
      Nearest nearest;
      world_.RayCast(&nearest, from, from + reach * b2Vec2(std::cos(angle), std::sin(angle)));
      ranges_[i] = nearest.fraction <= 1.0F ? nearest.fraction * reach + noise_(engine_)
                                            : std::numeric_limits<float>::infinity();
    }
    return ranges_[380];
  }

  const Drift& drift_;
  b2World world_;
  b2Body* truck_;
  std::mt19937 engine_{1000};
  std::normal_distribution<float> noise_{0.0F, 0.012F};
  float ranges_[761];
  std::size_t steps_ = 0;
};
#endif

double threadTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// The whole chain on one thread, dynamic truck at 1 kHz: simulated over computing time, the median of
// some drifts, each with its world built and its metrics taken. The best of them would tell of the
// easiest drift, and of the luckiest moment of a busy machine.
double closedLoopFactor() {
  const simulation::Scenario scenario =
      simulation::loadScenario(kPackage + "/scenarios/unseen_drifts.yaml");
  const simulation::Setup setup = simulation::loadSetup(scenario);
  std::vector<double> factors;
  for (std::uint64_t seed = kSeed; seed < kSeed + 9; ++seed) {
    const double start = threadTime();
    const simulation::EpisodeResult result = simulation::runEpisode(scenario, setup, {seed, false});
    const double spent = threadTime() - start;
    factors.push_back(result.track.empty() ? 0.0 : result.track.back().time / spent);
  }
  const auto middle = factors.begin() + static_cast<std::ptrdiff_t>(factors.size() / 2);
  std::nth_element(factors.begin(), middle, factors.end());
  return *middle;
}

}  // namespace

int main(int argc, char** argv) {
  Contest contest("simulator step", argc, argv);
  const Drift drift = makeDrift();
  OurCore ours(drift);
  volatile float seen = 0.0F;
  contest.add("ours", [&] { seen = ours.step(); });
#ifdef HAVE_BOX2D
  Box2dCore box2d(drift);
  contest.add("Box2D core", [&] { seen = box2d.step(); });
#else
  contest.missing("Box2D (libbox2d-dev)");
#endif
  if (!contest.run()) return 0;
#ifdef HAVE_BOX2D
  contest.requireFaster("Box2D core", "ours", 25.0);
#endif
  contest.requireAtLeast("steps a second and core", "1/s", 1e6 / contest.median("ours"), 100000.0);
  contest.requireAtLeast("closed loop, times real time", "1", closedLoopFactor(), 500.0);
  return contest.finish();
}
