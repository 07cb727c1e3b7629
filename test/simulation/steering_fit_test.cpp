// The steering's identification on the package's own truck and sensors.
#include "tunnel_pilot/vehicle/steering_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/drivers/preview_laws.h"
#include "tunnel_pilot/drivers/step_driver.h"
#include "tunnel_pilot/simulation/pilot.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/sensors.h"
#include "tunnel_pilot/simulation/simulator.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"
#include "tunnel_pilot/vehicle/truck_variation.h"

namespace tunnel_pilot::simulation {
namespace {

using vehicle::SteeringFit;
using vehicle::SteeringIdentification;
using vehicle::SteeringRecord;
using vehicle::TurnDirection;

const std::string kPackage = TUNNEL_PILOT_SOURCE_DIR;
constexpr double kDegree = 0.017453292519943295;
constexpr int kSeeds = 20;
constexpr double kNever = std::numeric_limits<double>::infinity();

vehicle::TruckParameters truckOf(std::uint64_t seed, double variation) {
  return vehicle::varied(vehicle::loadTruck(kPackage + "/config/truck.yaml"), seed, variation);
}

// Steps to both sides with pauses, small and large ones in turn [rad].
std::vector<double> steps(Random& random, double seconds, double largest) {
  std::vector<double> demands;
  double side = random.uniform() < 0.5 ? -1.0 : 1.0;
  for (int i = 0; static_cast<double>(demands.size()) < seconds / 0.02; ++i, side = -side) {
    const double size =
        (i / 2 % 2 == 0 ? random.uniform(0.8, 1.0) : random.uniform(0.1, 0.25)) * largest;
    const int hold = static_cast<int>(random.uniform(2.0, 3.5) / 0.02);
    demands.insert(demands.end(), static_cast<std::size_t>(hold), side * size);
  }
  return demands;
}

struct Recording {
  double seconds = 120.0;
  double largest = 20.0 * kDegree;
  double rate = kNever;  // of the command [rad/s]
  double speed = 2.0;    // [m/s]
  vehicle::Load load = vehicle::Load::kEmpty;
};

// The loaded truck at a steady speed on its rough road obeys a command that comes every 20 ms; its
// articulation is read every 10 to 20 ms, with the errors of a hinge sensor.
SteeringRecord recorded(const vehicle::TruckParameters& truck, std::uint64_t seed,
                        const Recording& how) {
  vehicle::DynamicTruckOptions options;
  options.road_seed = seed;
  options.load = how.load;
  vehicle::DynamicTruck plant(truck, options);
  plant.reset({}, 0.0, how.speed);
  Random random(seed, Stream::kWander);
  Sensor sensor({0.1 * kDegree, 0.3 * kDegree, 0.0, 0.0}, seed, Stream::kArticulation);
  const std::vector<double> demands = steps(random, how.seconds, how.largest);
  SteeringRecord record;
  double command = 0.0;
  std::size_t next_command = 0;
  double next_reading = 0.0;
  for (int i = 0; i < static_cast<int>(how.seconds * 1000.0); ++i) {
    const double time = 0.001 * i;
    if (i % 20 == 0) {
      const double change = demands[next_command++] - command;
      command += std::clamp(change, -0.02 * how.rate, 0.02 * how.rate);
      record.commanded.push_back({time, command});
    }
    if (time >= next_reading) {
      record.measured.push_back({time, sensor.measure(plant.state().articulation, 0.015)});
      next_reading = time + random.uniform(0.0095, 0.0195);
    }
    const double acceleration = std::clamp(how.speed - plant.state().speed, -1.0, 0.8);
    plant.step({command, acceleration + 0.2}, {}, 0.001);
  }
  return record;
}

SteeringFit fitted(const SteeringRecord& record, TurnDirection direction = TurnDirection::kBoth) {
  SteeringIdentification identification;
  identification.add(record);
  return identification.fit(direction);
}

// The pilot as the nodes make it up, with the step driver between preview driver and arbiter if it is
// wanted.
class SteppingPilot {
 public:
  SteppingPilot(const vehicle::TruckParameters& truck, bool steps, can::Bus& bus)
      : sensor_{truck.geometry.lidar_x, truck.geometry.lidar_y, 0.0},
        parameters_(loadPilot(kPackage + "/config")),
        perception_(parameters_.perception),
        driver_(drivers::makePreviewDriver(parameters_.preview_driver, truck.geometry)),
        arbiter_(parameters_.arbiter, truck),
        bridge_(parameters_.bridge, truck.geometry, bus) {
    if (steps)
      steps_.emplace(drivers::loadStepDriver(config::loadFile(kPackage + "/config/step_driver.yaml")));
  }

  void takeScan(const geometry::Scan& scan, Stamp now) {
    const perception::Tunnel* tunnel =
        perception_.update(scan, sensor_, history_.poseAt(scan.stamp), now);
    if (tunnel == nullptr) return;
    arbiter_.setPoints(perception_.filtered().points->points, scan.stamp, now);
    arbiter_.setWalls(perception_.walls(), now);
    arbiter_.setTunnel(*tunnel, now);
    const drivers::Proposal proposal = driver_->propose(*tunnel, bridge_.motion(), now);
    arbiter_.setProposal(supervision::Source::kPreviewDriver, proposal, now);
    if (steps_) {
      arbiter_.setProposal(supervision::Source::kTeleoperation, steps_->propose(proposal, now), now);
    }
  }

  void tick(Stamp now) {
    using bridge::SafetyState;
    bridge_.tick(now);
    const SafetyState state = bridge_.status().state;
    if (state == SafetyState::kStandby) bridge_.engage(now);
    if (bridge_.motionFresh(now)) {
      history_.add(bridge_.motion(), now);
      arbiter_.setMotion(bridge_.motion(), now);
    }
    arbiter_.setTruckState({driving(), state == SafetyState::kStopping || state == SafetyState::kStopped,
                            bridge_.status().reason},
                           now);
    if (now < next_decision_) return;
    next_decision_ = now + fromSeconds(0.02);
    command_ = arbiter_.decide(now).command;
    bridge_.setCommand(command_, now);
    if (!driving()) return;
    record.commanded.push_back({toSeconds(now), command_.articulation_angle});
    const drivers::Motion& motion = bridge_.motion();
    const double time = toSeconds(motion.stamp);
    if (!record.measured.empty() && time <= record.measured.back().time) return;
    record.measured.push_back({time, motion.articulation});
  }

  bool driving() const {
    return bridge_.status().state == bridge::SafetyState::kActive ||
           bridge_.status().state == bridge::SafetyState::kDegraded;
  }

  SteeringRecord record;

 private:
  geometry::Pose sensor_;
  PilotParameters parameters_;
  PerceptionChain perception_;
  std::unique_ptr<drivers::PathDriver> driver_;
  std::optional<drivers::StepDriver> steps_;
  supervision::Arbiter arbiter_;
  bridge::CanBridge bridge_;
  drivers::MotionHistory history_;
  supervision::Command command_;
  Stamp next_decision_{};
};

// A drive of the empty truck through a drift that every seed lays out anew.
SteeringRecord driven(const vehicle::TruckParameters& truck, std::uint64_t seed, bool steps) {
  can::MemoryBusHub hub;
  const std::unique_ptr<can::Bus> truck_side = hub.connect();
  const std::unique_ptr<can::Bus> pilot_side = hub.connect();
  vehicle::DynamicTruckOptions options;
  options.load = vehicle::Load::kEmpty;
  options.road_seed = seed;
  Simulator simulator(loadSimulator(config::loadFile(kPackage + "/config/simulator.yaml")),
                      loadTruckController(config::loadFile(kPackage + "/config/truck_controller.yaml")),
                      truck, std::make_unique<vehicle::DynamicTruck>(truck, options), options.load,
                      world::loadWorld(kPackage + "/worlds/random_drift.yaml", {seed, false}), seed,
                      *truck_side);
  SteppingPilot pilot(truckOf(1, 0.0), steps, *pilot_side);
  while (simulator.now() < fromSeconds(steps ? 120.0 : 80.0)) {
    const Simulator::Events& events = simulator.step();
    if (events.scan != nullptr) pilot.takeScan(*events.scan, simulator.now());
    if (simulator.now() % fromSeconds(0.01) == Stamp(0)) pilot.tick(simulator.now());
    EXPECT_LT(std::abs(simulator.truth().lateral_offset), 0.25);
  }
  EXPECT_EQ(simulator.truth().contacts, 0U);
  EXPECT_TRUE(pilot.driving());
  return pilot.record;
}

// What lies between a command and the readings that show it, besides the hydraulics: the command's
// frame, the reading and its frame (tools: identify_steering) [s].
constexpr double kOnTheWay = 0.035;

// Errors of all seeds.
struct Errors {
  std::vector<double> dead_times, rates, lags;

  void take(const SteeringFit& fit, const vehicle::HydraulicSteering& truth, double on_the_way) {
    ASSERT_TRUE(fit.dead_time.known()) << fit.dead_time.refusal;
    ASSERT_TRUE(fit.lag.known()) << fit.lag.refusal;
    dead_times.push_back(std::abs(fit.dead_time.value - on_the_way - truth.dead_time));
    lags.push_back(std::abs(fit.lag.value / truth.lag - 1.0));
    EXPECT_LT(dead_times.back(), 0.020);
    EXPECT_LT(lags.back(), 0.10);
    if (!fit.rate.known()) return;
    rates.push_back(std::abs(fit.rate.value / truth.max_rate - 1.0));
    EXPECT_LT(rates.back(), 0.05);
  }

  // For the documents.
  void tell() {
    for (auto* errors : {&dead_times, &rates, &lags}) std::sort(errors->begin(), errors->end());
    std::printf(
        "median / worst of %zu: dead time %.1f / %.1f ms, lag %.1f / %.1f %%, %zu rates %.2f / %.2f "
        "%%\n",
        dead_times.size(), 1e3 * dead_times[dead_times.size() / 2], 1e3 * dead_times.back(),
        100.0 * lags[lags.size() / 2], 100.0 * lags.back(), rates.size(),
        100.0 * rates[rates.size() / 2], 100.0 * rates.back());
  }
};

void expectFound(double variation) {
  Errors errors;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const vehicle::TruckParameters truck = truckOf(seed, variation);
    const SteeringFit fit = fitted(recorded(truck, seed, {}));
    errors.take(fit, truck.steering, 0.0);
    EXPECT_TRUE(fit.rate.known()) << fit.rate.refusal;
  }
  errors.tell();
}

TEST(SteeringFit, FindsTheNominalTruckFromSteps) { expectFound(0.0); }

TEST(SteeringFit, FindsTrucksThatAreOffByAFifthFromSteps) { expectFound(0.2); }

// Through perception, arbiter, bridge and CAN. The arbiter asks for no more than 15 deg/s, so that a
// faster truck's rate stays unknown.
TEST(SteeringFit, FindsTrucksThatAreOffByAFifthFromADriveWithSteps) {
  Errors errors;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const vehicle::TruckParameters truck = truckOf(seed, 0.2);
    const SteeringFit fit = fitted(driven(truck, seed, true));
    errors.take(fit, truck.steering, kOnTheWay);
    if (truck.steering.max_rate > 13.8 * kDegree) {
      EXPECT_NE(fit.rate.refusal.find("did not ask for more"), std::string::npos);
    } else if (truck.steering.max_rate < 13.2 * kDegree) {
      EXPECT_TRUE(fit.rate.known()) << fit.rate.refusal;
    }
  }
  errors.tell();
}

std::string refusalOf(const SteeringRecord& record) {
  try {
    fitted(record);
    return "";
  } catch (const vehicle::CannotTell& error) {
    return error.what();
  }
}

TEST(SteeringFit, AnOrdinaryDriveIsTooEvenAndIsRefused) {
  for (const std::uint64_t seed : {7, 10, 12}) {
    EXPECT_NE(refusalOf(driven(truckOf(seed, 0.0), seed, false)).find("too evenly"), std::string::npos);
  }
}

TEST(SteeringFit, TheSidesOfASymmetricTruckAreAlike) {
  SteeringRecord record = recorded(truckOf(1, 0.0), 1, {});
  const SteeringFit left = fitted(record, TurnDirection::kLeft);
  const SteeringFit right = fitted(record, TurnDirection::kRight);
  EXPECT_NEAR(left.rate.value, right.rate.value, 0.01 * left.rate.value);
  EXPECT_NEAR(left.dead_time.value, right.dead_time.value, 0.01);
  const SteeringFit both = fitted(record);
  EXPECT_NEAR(static_cast<double>(left.samples + right.samples), static_cast<double>(both.samples),
              300.0);
  EXPECT_GT(both.left, 15U);
  EXPECT_GT(both.right, 15U);
}

TEST(SteeringFit, SmallStepsAreRefusedTheRate) {
  Recording how;
  how.largest = 3.0 * kDegree;
  how.rate = 12.0 * kDegree;
  const SteeringFit fit = fitted(recorded(truckOf(1, 0.0), 1, how));
  EXPECT_FALSE(fit.rate.known());
  EXPECT_NE(fit.rate.refusal.find("at least"), std::string::npos) << fit.rate.refusal;
}

TEST(SteeringFit, AWrongSignIsNamed) {
  SteeringRecord record = recorded(truckOf(1, 0.0), 1, {});
  for (vehicle::TimedAngle& at : record.measured) at.angle = -at.angle;
  EXPECT_NE(refusalOf(record).find("sign"), std::string::npos);
}

TEST(SteeringFit, AStuckArticulationIsRefused) {
  SteeringRecord record = recorded(truckOf(1, 0.0), 1, {});
  Random random(1, Stream::kArticulation);
  for (vehicle::TimedAngle& at : record.measured) at.angle = 0.1 * kDegree * random.normal();
  EXPECT_NE(refusalOf(record).find("does not follow"), std::string::npos);
}

TEST(SteeringFit, AShortRecordIsRefused) {
  Recording how;
  how.seconds = 15.0;
  EXPECT_NE(refusalOf(recorded(truckOf(1, 0.0), 1, how)).find("too short"), std::string::npos);
}

TEST(SteeringFit, ImpossibleNumbersAreRefused) {
  const SteeringRecord good = recorded(truckOf(1, 0.0), 1, {});
  const auto expectRefused = [&](const std::function<void(SteeringRecord&)>& spoil) {
    SteeringRecord bad = good;
    spoil(bad);
    SteeringIdentification identification;
    EXPECT_THROW(identification.add(bad), std::invalid_argument);
  };
  expectRefused([](SteeringRecord& r) { r.measured[100].angle = NAN; });
  expectRefused([](SteeringRecord& r) { r.commanded[100].angle = INFINITY; });
  expectRefused([](SteeringRecord& r) { r.measured[100].time = NAN; });
  expectRefused([](SteeringRecord& r) { r.measured[100].time = r.measured[99].time; });
  expectRefused([](SteeringRecord& r) { r.commanded[100].time = 0.0; });
  expectRefused([](SteeringRecord& r) { r.measured[100].angle = 12.0; });  // degrees
}

// An operator turns from lock to lock with the wheel held over, the truck rolling at 1.5 m/s.
std::vector<vehicle::TimedAngle> swept(const vehicle::TruckParameters& truck, std::uint64_t seed) {
  Recording how;
  how.seconds = 60.0;
  how.speed = 1.5;
  std::vector<vehicle::TimedAngle> measured;
  vehicle::DynamicTruckOptions options;
  options.load = vehicle::Load::kEmpty;
  vehicle::DynamicTruck plant(truck, options);
  plant.reset({}, 0.0, how.speed);
  Sensor sensor({0.1 * kDegree, 0.3 * kDegree, 0.0, 0.0}, seed, Stream::kArticulation);
  for (int i = 0; i < 60000; ++i) {
    const double wheel = i / 8000 % 2 == 0 ? 40.0 * kDegree : -40.0 * kDegree;
    plant.step({wheel, std::clamp(how.speed - plant.state().speed, -1.0, 0.8) + 0.4}, {}, 0.001);
    if (i % 20 == 0) measured.push_back({0.001 * i, sensor.measure(plant.state().articulation, 0.02)});
  }
  return measured;
}

TEST(SweepRates, AreTheHydraulicsRates) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const vehicle::TruckParameters truck = truckOf(seed, 0.2);
    const vehicle::SweepRates rates = vehicle::sweepRates(swept(truck, seed));
    for (const vehicle::Estimate& rate : {rates.left, rates.right}) {
      ASSERT_TRUE(rate.known()) << rate.refusal;
      worst = std::max(worst, std::abs(rate.value / truck.steering.max_rate - 1.0));
    }
  }
  EXPECT_LT(worst, 0.05);
  std::printf("worst rate: %.2f %%\n", 100.0 * worst);
}

TEST(SweepRates, OneSweepIsNotEnough) {
  std::vector<vehicle::TimedAngle> measured = swept(truckOf(1, 0.0), 1);
  measured.resize(measured.size() / 6);
  EXPECT_FALSE(vehicle::sweepRates(measured).left.known());
  EXPECT_FALSE(vehicle::sweepRates({}).right.known());
}

TEST(SweepRates, SweepsThatDifferAreRefused) {
  std::vector<vehicle::TimedAngle> measured = swept(truckOf(1, 0.0), 1);
  for (vehicle::TimedAngle& at : measured) at.time += at.time > 30.0 ? 0.3 * (at.time - 30.0) : 0.0;
  EXPECT_NE(vehicle::sweepRates(measured).left.refusal.find("differ"), std::string::npos);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
