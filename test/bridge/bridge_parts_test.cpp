#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tunnel_pilot/bridge/bridge_parameters.h"
#include "tunnel_pilot/bridge/command_sender.h"
#include "tunnel_pilot/bridge/heartbeat_watch.h"
#include "tunnel_pilot/bridge/odometry.h"
#include "tunnel_pilot/bridge/steering_watch.h"
#include "tunnel_pilot/bridge/transmit_watch.h"
#include "tunnel_pilot/bridge/truck_link.h"
#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

namespace tunnel_pilot::bridge {
namespace {

constexpr double kDeg = 3.14159265358979323846 / 180.0;

std::string configFile(const std::string& name) {
  return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name;
}
vehicle::TruckParameters truck() { return vehicle::loadTruck(configFile("truck.yaml")); }
Stamp ms(int milliseconds) { return std::chrono::milliseconds(milliseconds); }

// -------- parameters

TEST(BridgeParameters, ShippedFileLoads) {
  EXPECT_NO_THROW(loadBridge(config::loadFile(configFile("can_bridge.yaml"))));
}

TEST(BridgeParameters, EveryKeyIsNeededAndOfTheRightKind) {
  const YAML::Node good = YAML::LoadFile(configFile("can_bridge.yaml"));
  int keys = 0;
  const auto refused = [](const YAML::Node& yaml, const std::string& key) {
    try {
      loadBridge(config::Node(yaml, "can_bridge.yaml"));
    } catch (const config::ConfigError& e) {
      return std::string(e.what()).find("'" + key + "'") != std::string::npos;
    }
    return false;
  };
  for (const auto& entry : good) {
    const std::string key = entry.first.Scalar();
    YAML::Node missing = YAML::Clone(good);
    missing.remove(key);
    EXPECT_TRUE(refused(missing, key)) << key;
    for (const char* bad : {".nan", ".inf", "-1", "1e9", "'1'", "text", "~", "[1]"}) {
      YAML::Node wrong = YAML::Clone(good);
      wrong[key] = YAML::Load(bad);
      EXPECT_THROW(loadBridge(config::Node(wrong, "x")), config::ConfigError) << key << ": " << bad;
    }
    ++keys;
  }
  EXPECT_EQ(keys, 28);
  YAML::Node unknown = YAML::Clone(good);
  unknown["typo"] = 1;
  EXPECT_TRUE(refused(unknown, "typo"));
}

// -------- heartbeats

TEST(HeartbeatWatch, WhoWasNeverHeardIsSilent) {
  HeartbeatWatch watch({"/arbiter", "/centerline"}, 0.06);
  watch.heard("/centerline", ms(0));
  EXPECT_EQ(watch.silent(ms(1)), "/arbiter");
}

TEST(HeartbeatWatch, WhoIsHeardInTimeLives) {
  HeartbeatWatch watch({"/arbiter", "/centerline"}, 0.06);
  for (int t = 0; t < 2000; t += 60) {
    watch.heard("/arbiter", ms(t));
    watch.heard("/centerline", ms(t));
    EXPECT_FALSE(watch.silent(ms(t + 60)));
  }
}

TEST(HeartbeatWatch, WhoFallsSilentIsNamedAfterTheTimeoutAndLivesWhenHeardAgain) {
  HeartbeatWatch watch({"/arbiter", "/centerline"}, 0.06);
  watch.heard("/arbiter", ms(0));
  watch.heard("/centerline", ms(40));
  EXPECT_FALSE(watch.silent(ms(60)));
  EXPECT_EQ(watch.silent(ms(61)), "/arbiter");
  watch.heard("/arbiter", ms(70));
  EXPECT_FALSE(watch.silent(ms(100)));
}

TEST(HeartbeatWatch, OthersDoNotCount) {
  HeartbeatWatch watch({"/arbiter"}, 0.06);
  watch.heard("/stranger", ms(0));
  EXPECT_EQ(watch.silent(ms(1)), "/arbiter");
  EXPECT_FALSE(HeartbeatWatch({}, 0.06).silent(ms(1)));
}

TEST(BridgeParameters, AHeartbeatsNodeHasANodesName) {
  YAML::Node yaml = YAML::LoadFile(configFile("can_bridge.yaml"));
  for (const char* good : {"[arbiter]", "[/arbiter]"}) {
    yaml["heartbeats"] = YAML::Load(good);
    EXPECT_NO_THROW(loadBridge(config::Node(yaml, "x"))) << good;
  }
  for (const char* bad : {"[1arbiter]", "[_arbiter]"}) {
    yaml["heartbeats"] = YAML::Load(bad);
    EXPECT_THROW(loadBridge(config::Node(yaml, "x")), config::ConfigError) << bad;
  }
}

// -------- odometry

constexpr SensorErrors kErrors = {0.005, 0.01, 0.0, 0.05 * kDeg, 0.05 * kDeg, 0.00002, 0.3 * kDeg};

// Of a truck whose front axle goes where it points to: the kinematic one.
constexpr SlipModel kNoSlip = {0.0, {1.0, 0.0, 0.0, 1.0, 100.0, 0.03, 0.3, 0.8}};

TEST(Odometry, FollowsTheTruckThroughAnS) {
  vehicle::KinematicTruck plant(truck());
  plant.reset(geometry::Pose(), 0.0, 3.0);
  Odometry odometry(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  for (int i = 0; i <= 40000; ++i) {  // 40 s, 120 m
    const vehicle::PlantState& state = plant.state();
    if (i % 20 == 0) {
      odometry.update(state.articulation, state.articulation_rate, state.speed, state.yaw_rate, ms(i));
    }
    plant.step({0.25 * std::sin(0.3e-3 * i), 0.0}, {}, 1e-3);
  }
  const geometry::Pose error = plant.state().pose.relative(odometry.motion().pose);
  EXPECT_LT(std::hypot(error.x, error.y), 0.06);
  EXPECT_LT(std::abs(error.heading), 0.001);
}

TEST(Odometry, HoldsItsWayWithTheSensorsErrors) {
  // Speed 1 % wrong, hinge 0.3 deg wrong, gyro 0.2 deg/s wrong: 5 s at rest, then 30 s (90 m) of
  // driving.
  vehicle::KinematicTruck plant(truck());
  plant.reset(geometry::Pose(), 0.0, 0.0);
  Odometry odometry(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  double way = 0.0;
  for (int i = 0; i <= 35000; ++i) {
    const vehicle::PlantState& state = plant.state();
    if (i % 20 == 0) {
      odometry.update(state.articulation + 0.3 * kDeg, state.articulation_rate, 1.01 * state.speed,
                      state.yaw_rate + 0.2 * kDeg, ms(i));
    }
    way += state.speed * 1e-3;
    const double drive = i > 5000 && state.speed < 3.0 ? 0.8 : 0.0;
    plant.step({0.2 * std::sin(0.4e-3 * i), drive}, {}, 1e-3);
  }
  const geometry::Pose error = plant.state().pose.relative(odometry.motion().pose);
  EXPECT_LT(std::hypot(error.x, error.y), 0.02 * way);
  EXPECT_LT(std::abs(error.heading), 1.0 * kDeg) << "the gyro's bias alone would be worth 6 deg";
  EXPECT_NEAR(odometry.gyroBias(), 0.2 * kDeg, 0.03 * kDeg);
}

// How far to the side of its course the dynamic truck, loaded, is lost in a 90 deg bend of 15 m.
double lostInABend(double yaw_gain, const SlipModel& slip) {
  vehicle::TruckParameters parameters = truck();
  parameters.tyre.yaw_gain = yaw_gain;
  vehicle::DynamicTruck plant(parameters, {});
  plant.reset(geometry::Pose(), 0.0, 3.0);
  Odometry odometry(parameters.geometry, 2.0, 0.05, kErrors, slip);
  for (int i = 0; i <= 12000; ++i) {
    const vehicle::PlantState& state = plant.state();
    if (i % 20 == 0) {
      odometry.update(state.articulation, state.articulation_rate, state.speed, state.yaw_rate, ms(i));
    }
    plant.step({i < 1000 ? 0.0 : 0.35, 0.3 * (3.0 - state.speed) + 0.2}, {}, 1e-3);
  }
  const geometry::Pose error = plant.state().pose.relative(odometry.motion().pose);
  return std::hypot(error.x, error.y);
}

TEST(Odometry, SeesTheTyresSlipInABend) {
  const SlipModel slip =
      loadBridge(config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/can_bridge.yaml"))
          .slip;
  EXPECT_LT(lostInABend(1.0, slip), 0.5 * lostInABend(1.0, kNoSlip));
}

TEST(Odometry, SeesTheSlipOfATruckThatTurnsLessThanItsHinge) {
  const SlipModel slip =
      loadBridge(config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/can_bridge.yaml"))
          .slip;
  EXPECT_LT(lostInABend(0.8, slip), 0.3 * lostInABend(0.8, kNoSlip));
}

TEST(Odometry, DoesNotLearnTheBiasWhileDriving) {
  Odometry odometry(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  for (int i = 0; i < 500; ++i) odometry.update(0.1, 0.0, 3.0, 0.3, ms(20 * i));
  EXPECT_EQ(odometry.gyroBias(), 0.0);
}

TEST(Odometry, UsesKinematicsWithoutAGyro) {
  Odometry odometry(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  odometry.update(12.0 * kDeg, 0.0, 3.0, std::nullopt, ms(0));
  EXPECT_NEAR(odometry.motion().yaw_rate, 7.05 * kDeg, 0.02 * kDeg);  // SPECIFICATION 1.0
}

TEST(Odometry, IntegratesNothingAcrossAClockThatJumped) {
  Odometry odometry(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  odometry.update(0.0, 0.0, 3.0, 0.0, ms(100000));
  odometry.forgetTime();
  odometry.update(0.0, 0.0, 3.0, 0.0, ms(0));
  EXPECT_EQ(odometry.motion().pose.x, 0.0);
  odometry.update(0.0, 0.0, 3.0, 0.0, ms(20));
  EXPECT_NEAR(odometry.motion().pose.x, 0.06, 1e-12);
}

// Many trucks with errors drawn from the deviations that the odometry is told: squared errors over their
// covariance (x, y, heading) must be three on average.
TEST(Odometry, KnowsHowFarOffItMayBe) {
  constexpr int kTrucks = 200;
  std::mt19937 engine(1);
  std::normal_distribution<double> normal;
  double sum = 0.0;
  for (int truck_number = 0; truck_number < kTrucks; ++truck_number) {
    const double scale = 1.0 + kErrors.speed_scale * normal(engine);
    double bias = kErrors.gyro_bias * normal(engine);
    Odometry odometry(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
    geometry::Pose pose;
    for (int i = 0; i <= 2000; ++i) {  // 5 s at rest, then 35 s: an S of 100 m
      const auto speed = [](int at) { return at < 250 ? 0.0 : 3.0; };
      const auto yaw_rate = [](int at) { return at < 250 ? 0.0 : 0.25 * std::sin(0.004 * at); };
      if (i > 0) {
        const double turn = 0.01 * (yaw_rate(i - 1) + yaw_rate(i));
        const double way = 0.01 * (speed(i - 1) + speed(i));
        pose.x += way * std::cos(pose.heading + 0.5 * turn);
        pose.y += way * std::sin(pose.heading + 0.5 * turn);
        pose.heading += turn;
      }
      bias += std::sqrt(0.02) * kErrors.gyro_drift * normal(engine);
      odometry.update(0.0, 0.0, scale * speed(i) + kErrors.speed * normal(engine),
                      yaw_rate(i) + bias + kErrors.yaw_rate * normal(engine), ms(20 * i));
    }
    const auto& measured = odometry.motion().pose;
    const Eigen::Vector3d error(measured.x - pose.x, measured.y - pose.y,
                                geometry::wrapAngle(measured.heading - pose.heading));
    sum += error.dot(odometry.poseCovariance().ldlt().solve(error));
  }
  EXPECT_NEAR(sum / kTrucks, 3.0, 1.0);
}

TEST(Odometry, IsLessSureWithoutAGyro) {
  Odometry with(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  Odometry without(truck().geometry, 2.0, 0.05, kErrors, kNoSlip);
  for (int i = 0; i <= 1000; ++i) {
    with.update(0.0, 0.0, 3.0, 0.0, ms(20 * i));
    without.update(0.0, 0.0, 3.0, std::nullopt, ms(20 * i));
  }
  EXPECT_GT(without.poseCovariance()(2, 2), with.poseCovariance()(2, 2));
  EXPECT_GT(without.twistVariance()(2), with.twistVariance()(2));
  // 0.3 deg at the hinge are 0.18 deg/s at 3 m/s: 3.5 deg in 20 s.
  EXPECT_NEAR(std::sqrt(without.poseCovariance()(2, 2)), 3.5 * kDeg, 0.1 * kDeg);
}

// -------- steering response

TEST(SteeringResponse, HasDeadTimeThenRampThenLag) {
  SteeringResponse response(0.15, 15.0 * kDeg, 0.20);
  response.reset(0.0, ms(0));
  double at_dead_time = -1.0, at_one_second = -1.0;
  for (int i = 0; i <= 5000; ++i) {
    const double angle = response.step(i > 0 ? 20.0 * kDeg : 0.0, ms(i));
    if (i == 150) at_dead_time = angle;
    if (i == 1151) at_one_second = angle;
  }
  EXPECT_EQ(at_dead_time, 0.0);
  // A ramp of 15 deg/s lasting 1 s behind a lag of 0.2 s: 15 (1 - 0.2 (1 - e^-5)).
  EXPECT_NEAR(at_one_second / kDeg, 15.0 * (1.0 - 0.2 * (1.0 - std::exp(-5.0))), 0.05);
  EXPECT_NEAR(response.step(20.0 * kDeg, ms(5001)), 20.0 * kDeg, 1e-6);
}

TEST(SteeringResponse, ActsWhenTheDeadTimeIsOver) {
  for (const double angle : {20.0 * kDeg, -20.0 * kDeg}) {
    SteeringResponse response(0.15, 15.0 * kDeg, 0.20);
    response.reset(0.0, ms(0));
    response.step(angle, ms(10));
    EXPECT_EQ(response.step(angle, ms(159)), 0.0);
    // 1 ms of the highest rate, of which the lag lets so much through.
    const double ramp = std::copysign(15.0 * kDeg * 1e-3, angle);
    EXPECT_NEAR(response.step(angle, ms(160)), ramp * (1.0 - std::exp(-1e-3 / 0.20)), 1e-15);
  }
}

TEST(SteeringResponse, EachAngleActsInItsTurn) {
  SteeringResponse response(0.15, 100.0, 1e-3);  // no rate, no lag to speak of
  response.reset(0.0, ms(0));
  for (int i = 0; i < 100; ++i) {
    const double angle = response.step(0.01 * (i / 10), ms(10 * i));
    if (i < 15 || i % 10 != 5) continue;
    EXPECT_NEAR(angle, 0.01 * ((i - 15) / 10), 1e-4) << i;
  }
}

TEST(SteeringResponse, AnAngleThatWasHeldForLongActsAfterTheDeadTimeAsWell) {
  SteeringResponse response(0.15, 100.0, 1e-3);
  response.reset(0.0, ms(0));
  for (int i = 0; i < 100; ++i) response.step(0.1, ms(10 * i));
  response.step(0.2, ms(1000));
  EXPECT_NEAR(response.step(0.2, ms(1140)), 0.1, 1e-6);
  EXPECT_NEAR(response.step(0.2, ms(1160)), 0.2, 1e-3);
}

TEST(SteeringResponse, AResetForgetsWhatWasSent) {
  SteeringResponse response(0.15, 15.0 * kDeg, 0.20);
  response.reset(0.0, ms(0));
  for (int i = 0; i < 30; ++i) response.step(0.01 * i, ms(10 * i));
  response.reset(0.3, ms(300));
  for (int i = 0; i < 30; ++i) EXPECT_EQ(response.step(0.3, ms(310 + 10 * i)), 0.3);
}

TEST(SteeringResponse, AResetBeginsTheTimeAnew) {
  SteeringResponse response(0.0, 1.0, 1e-9);  // [rad/s]; no lag to speak of
  response.reset(0.0, ms(0));
  response.reset(0.0, ms(10000));
  EXPECT_NEAR(response.step(1.0, ms(10020)), 0.02, 1e-12);
}

TrackingParameters tracking() {
  return loadBridge(config::loadFile(configFile("can_bridge.yaml"))).tracking;
}

TEST(SteeringWatch, AcceptsEveryPumpBetweenIdleAndWorkingSpeed) {
  for (const double rate : {9.0, 12.0, 15.0}) {
    SteeringWatch watch(tracking());
    SteeringResponse plant(0.15, rate * kDeg, 0.2);
    watch.reset(0.0, ms(0));
    plant.reset(0.0, ms(0));
    for (int i = 1; i < 8000; ++i) {
      const double sent = std::min(15.0e-3 * i, 40.0) * kDeg;
      watch.step(sent, plant.step(sent, ms(i)), ms(i));
      ASSERT_LT(watch.error(), 0.01 * kDeg) << rate;
    }
  }
}

TEST(SteeringWatch, FindsAValveThatRunsAway) {
  SteeringWatch watch(tracking());
  watch.reset(0.0, ms(0));
  int failed_at = 0;
  for (int i = 1; i < 3000 && failed_at == 0; ++i) {
    watch.step(0.0, -15.0e-3 * i * kDeg, ms(i));
    if (watch.failed(ms(i))) failed_at = i;
  }
  EXPECT_NEAR(failed_at, 834, 3);  // 5 deg at 333 ms, and 500 ms more
}

TEST(SteeringWatch, TheErrorIsTheDistanceToWhatIsExpected) {
  SteeringWatch watch(tracking());
  watch.reset(0.0, ms(0));
  EXPECT_EQ(watch.error(), 0.0);
  watch.step(0.1, 0.3, ms(1));  // between 0, as it was, and 0.1, as it is sent
  EXPECT_NEAR(watch.error(), 0.2, 1e-12);
  watch.step(0.1, -0.3, ms(2));
  EXPECT_NEAR(watch.error(), 0.3, 1e-12);
  watch.step(0.1, 0.05, ms(3));
  EXPECT_EQ(watch.error(), 0.0);
}

TEST(SteeringWatch, ExpectsAnythingBetweenTheSlowestAndTheFastestPump) {
  SteeringWatch watch(tracking());
  watch.reset(0.0, ms(0));
  for (int i = 1; i <= 1000; ++i) watch.step(0.3, 0.1, ms(i));
  for (int i = 1001; i <= 1100; ++i)
    watch.step(-0.3, 0.1, ms(i));  // the dead time: both still turn left
  SteeringResponse fast(0.15, tracking().max_rate, tracking().lag);
  SteeringResponse slow(0.15, tracking().min_rate, tracking().lag);
  fast.reset(0.0, ms(0));
  slow.reset(0.0, ms(0));
  double high = 0.0, low = 0.0;
  for (int i = 1; i <= 1000; ++i) high = fast.step(0.3, ms(i)), low = slow.step(0.3, ms(i));
  for (int i = 1001; i <= 1101; ++i) high = fast.step(-0.3, ms(i)), low = slow.step(-0.3, ms(i));
  EXPECT_GT(high, low + 0.01);
  watch.step(-0.3, high + 0.02, ms(1101));
  EXPECT_NEAR(watch.error(), 0.02, 1e-12);
  watch.step(-0.3, -0.31, ms(1102));
  EXPECT_NEAR(watch.error(), 0.01, 1e-12);
}

TEST(SteeringWatch, FailsOnlyAfterItsTimeBeyondItsLargestError) {
  const double largest = tracking().max_error;
  const int time = static_cast<int>(std::lround(1e3 * tracking().max_time));
  SteeringWatch watch(tracking());
  watch.reset(0.0, ms(0));
  watch.step(0.0, largest, ms(100));  // just still good
  watch.step(0.0, 1.01 * largest, ms(101));
  EXPECT_FALSE(watch.failed(ms(100 + time)));
  EXPECT_TRUE(watch.failed(ms(101 + time)));
}

TEST(SteeringWatch, AResetBeginsAnew) {
  SteeringWatch watch(tracking());
  watch.reset(0.0, ms(0));
  for (int i = 1; i < 1000; ++i) watch.step(0.0, 0.3, ms(i));
  ASSERT_TRUE(watch.failed(ms(1000)));
  watch.reset(0.3, ms(1000));
  EXPECT_EQ(watch.error(), 0.0);
  EXPECT_FALSE(watch.failed(ms(1001)));
  watch.step(0.3, 0.3, ms(1001));
  EXPECT_EQ(watch.error(), 0.0);
  watch.step(0.3, 0.2, ms(1002));
  EXPECT_NEAR(watch.error(), 0.1, 1e-12) << "both responses begin at the angle of the reset";
}

TEST(SteeringWatch, ForgivesAnErrorThatPasses) {
  SteeringWatch watch(tracking());
  watch.reset(0.0, ms(0));
  for (int i = 1; i < 5000; ++i) {
    watch.step(0.0, (i % 500 < 450 ? 6.0 : 4.0) * kDeg, ms(i));
    ASSERT_FALSE(watch.failed(ms(i))) << i;
  }
}

// -------- transmission

TEST(TransmitWatch, NeverHasMoreThanTwoSetsOnTheirWay) {
  TransmitWatch watch;
  watch.sent(3, ms(0));
  EXPECT_FALSE(watch.full());
  watch.sent(3, ms(20));
  EXPECT_TRUE(watch.full());
  watch.update(3, ms(21));
  EXPECT_FALSE(watch.full());
}

TEST(TransmitWatch, TheAgeIsThatOfTheOldestFrameInFlight) {
  TransmitWatch watch;
  watch.sent(3, ms(0));
  watch.update(1, ms(30));
  EXPECT_FALSE(watch.stalled());
  watch.sent(3, ms(30));
  watch.update(4, ms(35));
  EXPECT_TRUE(watch.stalled()) << "one frame of the first set";
  watch.update(3, ms(36));
  EXPECT_FALSE(watch.stalled());
  watch.update(3, ms(65));
  EXPECT_TRUE(watch.stalled());
  watch.update(0, ms(66));
  EXPECT_FALSE(watch.stalled());
}

TEST(TransmitWatch, AThirdSetIsNotTakenIn) {
  TransmitWatch watch;
  watch.sent(3, ms(0));
  watch.sent(3, ms(10));
  watch.sent(3, ms(20));
  watch.update(3, ms(30));
  EXPECT_FALSE(watch.full());
  watch.update(0, ms(100));
  EXPECT_FALSE(watch.stalled());
  watch.sent(3, ms(100));
  watch.update(3, ms(134));
  EXPECT_FALSE(watch.stalled());
}

TEST(TransmitWatch, StallsWhenTheOldestFrameIs34AndAHalfMillisecondsOld) {
  TransmitWatch watch;
  watch.sent(1, ms(0));
  watch.update(1, std::chrono::microseconds(34499));
  EXPECT_FALSE(watch.stalled());
  watch.update(1, std::chrono::microseconds(34500));
  EXPECT_TRUE(watch.stalled());
}

TEST(TransmitWatch, StallsAtATickOf5MillisecondsThatComesALittleEarly) {
  TransmitWatch watch;
  constexpr Stamp kJitter = std::chrono::microseconds(100);
  watch.sent(3, kJitter);
  watch.update(3, ms(30) - kJitter);
  EXPECT_FALSE(watch.stalled());
  watch.update(3, ms(35) - kJitter);
  EXPECT_TRUE(watch.stalled());
}

TEST(TransmitWatch, SetsOfDifferentSizesAreSettledInTheirOrder) {
  TransmitWatch watch;
  watch.sent(1, ms(0));
  watch.sent(3, ms(20));
  watch.update(4, ms(34));
  EXPECT_TRUE(watch.full());
  watch.update(3, ms(54));
  EXPECT_FALSE(watch.full());
  EXPECT_FALSE(watch.stalled());
  watch.update(1, ms(55));
  EXPECT_TRUE(watch.stalled()) << "the last frame of the second set";
  watch.sent(2, ms(56));
  watch.update(2, ms(57));
  EXPECT_FALSE(watch.stalled());
  EXPECT_FALSE(watch.full());
}

TEST(TransmitWatch, FramesInFlightThatItDoesNotKnowOfSettleNothing) {
  TransmitWatch watch;
  watch.sent(3, ms(0));
  watch.update(5, ms(10));
  watch.update(3, ms(35));
  EXPECT_TRUE(watch.stalled());
}

TEST(TransmitWatch, AfterAClockThatJumpedAgesBeginAnew) {
  TransmitWatch watch;
  watch.sent(3, ms(0));
  watch.sent(3, ms(10));
  watch.forgetTime(ms(5000));
  watch.update(6, ms(5034));
  EXPECT_FALSE(watch.stalled());
  watch.update(6, ms(5035));
  EXPECT_TRUE(watch.stalled());
  watch.update(3, ms(5036));
  EXPECT_TRUE(watch.stalled()) << "of the second set as well";
}

TEST(TransmitWatch, ASetOfWhichNothingWasTakenIsNotOnItsWay) {
  TransmitWatch watch;
  watch.sent(0, ms(0));
  watch.sent(0, ms(1));
  EXPECT_FALSE(watch.full());
  watch.update(0, ms(100));
  EXPECT_FALSE(watch.stalled());
}

// -------- sender

TEST(CommandSender, KeepsItsPeriodThoughTicksComeALittleEarlyOrLate) {
  CommandSender sender(0.02);
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  constexpr Stamp kJitter = std::chrono::microseconds(100);
  int sets = 0;
  for (int tick = 0; tick < 400; ++tick) {
    const Stamp now = ms(5 * tick) + (1 - tick % 3) * kJitter;
    if (!sender.due(false, now)) continue;
    EXPECT_EQ(tick % 4, 0);
    ++sets;
    EXPECT_TRUE(sender.send({}, {}, {}, *bus, now));
  }
  EXPECT_EQ(sets, 100);
}

TEST(CommandSender, ATickMayComeHalfAMillisecondEarly) {
  CommandSender sender(0.02);
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  sender.send({}, {}, {}, *bus, ms(0));
  EXPECT_FALSE(sender.due(false, std::chrono::microseconds(19499)));
  EXPECT_TRUE(sender.due(false, std::chrono::microseconds(19500)));
}

// When the set after one that was sent at `second` [us] is due, the first having been sent at 0 [us].
int nextAfter(int second) {
  CommandSender sender(0.02);
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  const auto us = [](int time) { return std::chrono::microseconds(time); };
  sender.send({}, {}, {}, *bus, us(0));
  sender.send({}, {}, {}, *bus, us(second));
  int time = second;
  while (!sender.due(false, us(time))) time += 100;
  return time + 500;
}

TEST(CommandSender, KeepsItsStepUnlessAPeriodWasMissed) {
  EXPECT_EQ(nextAfter(20000), 40000);
  EXPECT_EQ(nextAfter(19500), 40000) << "early";
  EXPECT_EQ(nextAfter(25000), 40000) << "late";
  EXPECT_EQ(nextAfter(39900), 40400) << "so late that the next comes at once";
  EXPECT_EQ(nextAfter(40000), 60000) << "a period too late: nothing is made up for";
  EXPECT_EQ(nextAfter(5000), 25000) << "a stop between";
  EXPECT_EQ(nextAfter(19400), 39400) << "likewise";
}

TEST(CommandSender, AStopIsDueAtOnceUntilItWasTold) {
  CommandSender sender(0.02);
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  can::TruckCommandFrame stop;
  stop.stop = true;
  sender.send({}, {}, {}, *bus, ms(0));
  EXPECT_TRUE(sender.due(true, ms(5)));
  sender.send(stop, {}, {}, *bus, ms(5));
  EXPECT_FALSE(sender.due(true, ms(10)));
  EXPECT_TRUE(sender.due(true, ms(25)));
  sender.send({}, {}, {}, *bus, ms(25));
  EXPECT_TRUE(sender.due(true, ms(26))) << "another one";
}

TEST(CommandSender, MakesUpForNothingAfterAGap) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  const auto wire = hub.connect();
  CommandSender sender(0.02);
  sender.send({}, {}, {}, *bus, ms(0));
  EXPECT_FALSE(sender.due(false, ms(19)));
  EXPECT_TRUE(sender.due(false, ms(20)));
  sender.send({}, {}, {}, *bus, ms(500));
  EXPECT_FALSE(sender.due(false, ms(519)));
  EXPECT_EQ(sender.framesSent(), 6u);
}

TEST(CommandSender, TheThreeFramesOfASetCarryTheSameCounterEachSetTheNext) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), wire = hub.connect();
  CommandSender sender(0.02);
  std::uint8_t before = 0;
  for (int i = 0; i < 20; ++i) {
    sender.send({}, {}, {}, *bus, ms(20 * i));
    const auto command = can::decode<can::TruckCommandFrame>(*wire->receive());
    const auto info = can::decode<can::CommandInfoFrame>(*wire->receive());
    const auto status = can::decode<can::BridgeStatusFrame>(*wire->receive());
    ASSERT_TRUE(command && info && status);
    EXPECT_EQ(command->counter, can::nextCounter(before));
    EXPECT_EQ(info->counter, command->counter);
    EXPECT_EQ(status->counter, command->counter);
    before = command->counter;
  }
}

TEST(CommandSender, IsBrokenAfterThreeSetsThatCouldNotBeSent) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  CommandSender sender(0.02);
  hub.setState(can::BusState::kDown);
  for (int i = 0; i < 3; ++i) {
    EXPECT_FALSE(sender.broken());
    sender.send({}, {}, {}, *bus, ms(20 * i));
  }
  EXPECT_TRUE(sender.broken());
  hub.setState(can::BusState::kActive);
  sender.send({}, {}, {}, *bus, ms(60));
  EXPECT_FALSE(sender.broken());
  hub.setState(can::BusState::kDown);
  for (int i = 4; i < 7; ++i) {
    EXPECT_FALSE(sender.broken()) << "three again";
    sender.send({}, {}, {}, *bus, ms(20 * i));
  }
  EXPECT_TRUE(sender.broken());
}

TEST(CommandSender, BlocksTheSeventeenthFrameOfAQuarterSecond) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  CommandSender sender(0.02);
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(i)));
  for (int time = 20; time < 250; time += 10) sender.pass(ms(time));
  EXPECT_FALSE(sender.send({}, {}, {}, *bus, ms(250)));
  EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(251)));
  EXPECT_EQ(sender.setsBlocked(), 1u);
}

TEST(CommandSender, IsBoundThoughTheClockJumpsAgainAndAgain) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  CommandSender sender(0.02);
  int sent = 0;
  for (int i = 0; i < 100; ++i) {  // within no time at all
    const Stamp now = ms(i % 2 == 0 ? 100000 : 5000);
    sender.forgetTime(now);
    if (sender.due(false, now) && sender.send({}, {}, {}, *bus, now)) ++sent;
  }
  EXPECT_EQ(sent, 16);
}

// The last set counts as sent at the jump, those before as long before it as they were.
TEST(CommandSender, TheBoundOnTheRateGoesOnOverAClockJump) {
  for (const int before : {1, 2, 16}) {
    can::MemoryBusHub hub;
    const auto bus = hub.connect();
    CommandSender sender(0.02);
    for (int i = 0; i < before; ++i) sender.send({}, {}, {}, *bus, ms(100000 + 10 * i));
    sender.forgetTime(ms(5000));
    for (int i = before; i < 16; ++i) EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(5001)));
    const int oldest = 5000 - 10 * (before - 1);
    for (int time = 5010; time < oldest + 250; time += 10) sender.pass(ms(time));
    EXPECT_FALSE(sender.send({}, {}, {}, *bus, ms(oldest + 250))) << before;
    EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(oldest + 251))) << before;
  }
}

// Forward it is no jump that anybody tells of: the time simply is much later.
TEST(CommandSender, AClockThatGoesForwardAndBackMakesNoRoom) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  CommandSender sender(0.02);
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(i)));
  EXPECT_FALSE(sender.send({}, {}, {}, *bus, ms(1000)));
  sender.forgetTime(ms(20));
  EXPECT_FALSE(sender.send({}, {}, {}, *bus, ms(30)));
}

TEST(CommandSender, ATickAddsUpTo25MsToTheTimeOfTheBound) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  CommandSender sender(0.02);
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(0)));
  for (int i = 1; i <= 9; ++i) sender.pass(ms(1000 * i));
  EXPECT_FALSE(sender.send({}, {}, {}, *bus, ms(10000)));
  EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(10001))) << "251 ms";
}

TEST(CommandSender, ADriveAtItsPaceSendsAtOnceAfterAClockJump) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect();
  CommandSender sender(0.02);
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(20 * i)));
  sender.forgetTime(ms(3));
  EXPECT_TRUE(sender.due(false, ms(3)));
  EXPECT_TRUE(sender.send({}, {}, {}, *bus, ms(3)));
}

TEST(CommandSender, ASetThatCannotBeEncodedFailsAndNothingOfItIsSent) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), wire = hub.connect();
  CommandSender sender(0.02);
  can::TruckCommandFrame impossible;
  impossible.speed = std::nan("");
  sender.send(impossible, {}, {}, *bus, ms(0));
  EXPECT_EQ(sender.setsFailed(), 1u);
  EXPECT_EQ(sender.framesSent(), 0u);
  EXPECT_FALSE(wire->receive());
}

// A bus that takes so many frames and no more.
class ShortBus : public can::Bus {
 public:
  explicit ShortBus(int room) : room_(room) {}
  bool send(const can::Frame&) override { return room_-- > 0; }
  std::optional<can::Frame> receive() override { return std::nullopt; }
  std::uint64_t confirmed() const override { return 0; }
  can::BusState state() const override { return can::BusState::kActive; }
  int descriptor() const override { return -1; }

 private:
  int room_;
};

TEST(CommandSender, ASetThatWasNotTakenToItsLastFrameFails) {
  for (const int room : {0, 1, 2}) {
    ShortBus bus(room);
    CommandSender sender(0.02);
    sender.send({}, {}, {}, bus, ms(0));
    EXPECT_EQ(sender.setsFailed(), 1u) << room;
    EXPECT_EQ(sender.framesSent(), static_cast<std::uint32_t>(room));
  }
  ShortBus bus(3);
  CommandSender sender(0.02);
  sender.send({}, {}, {}, bus, ms(0));
  EXPECT_EQ(sender.setsFailed(), 0u);
}

TEST(CommandSender, IsSilentWhenThreeCommandsInARowWereRefusedNotWhenTheirSetsBroke) {
  ShortBus none(0), one(1);
  CommandSender sender(0.02);
  for (int set = 0; set < 3; ++set) {
    EXPECT_FALSE(sender.silent());
    sender.send({}, {}, {}, none, ms(20 * set));
  }
  EXPECT_TRUE(sender.silent());
  sender.send({}, {}, {}, one, ms(60));
  EXPECT_FALSE(sender.silent());
  EXPECT_TRUE(sender.broken());
}

// -------- link

TEST(TruckLink, AnyFrameOfOurOwnFromElsewhereIsAForeignSenders) {
  for (const std::uint32_t id : {can::kTpCommandId, can::kTpCommandInfoId, can::kTpStatusId}) {
    can::MemoryBusHub hub;
    const auto bus = hub.connect(), peer = hub.connect();
    TruckLink link(0.06);
    can::Frame frame;
    frame.id = id;
    peer->send(frame);
    link.receive(*bus, ms(0));
    EXPECT_TRUE(link.foreignSender()) << id;
    EXPECT_EQ(link.framesRejected(), 1u);
    link.receive(*bus, ms(20));
    EXPECT_FALSE(link.foreignSender()) << "only in the last call";
  }
}

// A bus that is told the time, and has a frame of the truck's in every other call.
class TellingBus : public ShortBus {
 public:
  TellingBus() : ShortBus(0) {}
  void tick(Stamp now) override {
    ticks.push_back(now);
    if (ticks.size() % 2 == 1) waiting_ = can::encode(can::TruckFeedbackFrame());
  }
  std::optional<can::Frame> receive() override { return std::exchange(waiting_, std::nullopt); }
  std::vector<Stamp> ticks;

 private:
  std::optional<can::Frame> waiting_;
};

TEST(TruckLink, TellsTheBusTheTimeBeforeItReadsAndOfNewFeedbackOnce) {
  TellingBus bus;
  TruckLink link(0.06);
  EXPECT_TRUE(link.receive(bus, ms(7)));
  EXPECT_FALSE(link.receive(bus, ms(12)));
  EXPECT_EQ(bus.ticks, (std::vector<Stamp>{ms(7), ms(12)}));
}

TEST(TruckLink, AFirstFrameCameAtTheFirstCallALaterOneAfterTheCallBefore) {
  TellingBus bus;
  TruckLink link(0.06);
  link.receive(bus, ms(1000));
  EXPECT_EQ(link.feedbackStamp(), ms(1000));
  can::MemoryBusHub hub;
  const auto own = hub.connect(), peer = hub.connect();
  can::TruckFeedbackFrame next;
  next.counter = 1;
  peer->send(*can::encode(next));
  link.receive(*own, ms(1005));
  EXPECT_EQ(link.feedbackStamp(), ms(1000));
  next.counter = 2;
  peer->send(*can::encode(next));
  link.receive(*own, ms(1010));
  EXPECT_EQ(link.feedbackStamp(), ms(1005));
}

TEST(TruckLink, TakesTheOperatorsInputsAndTheCoils) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), peer = hub.connect();
  TruckLink link(0.06);
  can::OperatorFrame inputs;
  inputs.throttle = 0.25;
  can::Coils1Frame coils1;
  coils1.coils[0] = 0.5;
  can::Coils2Frame coils2;
  coils2.coils[2] = 0.75;
  peer->send(*can::encode(inputs));
  peer->send(*can::encode(coils1));
  peer->send(*can::encode(coils2));
  EXPECT_FALSE(link.receive(*bus, ms(0))) << "no feedback among them";
  EXPECT_NEAR(link.operatorInputs().throttle, 0.25, 0.01);
  EXPECT_NEAR(link.coils1().coils[0], 0.5, 0.01);
  EXPECT_NEAR(link.coils2().coils[2], 0.75, 0.01);
  EXPECT_EQ(link.framesRejected(), 0u);
}

TEST(TruckLink, EachOfTheThreeStreamsIsCorruptByItself) {
  const can::Frame frames[] = {*can::encode(can::TruckFeedbackFrame()),
                               *can::encode(can::TruckMotionFrame()),
                               *can::encode(can::TruckStatusFrame())};
  for (can::Frame frame : frames) {
    can::MemoryBusHub hub;
    const auto bus = hub.connect(), peer = hub.connect();
    TruckLink link(0.06);
    frame.data[0] ^= 1;
    for (int i = 0; i < 3; ++i) {
      EXPECT_FALSE(link.corrupt()) << i;
      peer->send(frame);
      link.receive(*bus, ms(i));
    }
    EXPECT_TRUE(link.corrupt()) << frame.id;
  }
}

TEST(TruckLink, CorruptFramesOfTheOperatorAndTheCoilsAreOnlyCounted) {
  const can::Frame frames[] = {*can::encode(can::OperatorFrame()), *can::encode(can::Coils1Frame()),
                               *can::encode(can::Coils2Frame())};
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), peer = hub.connect();
  TruckLink link(0.06);
  for (can::Frame frame : frames) {
    frame.data[0] ^= 1;
    for (int i = 0; i < 3; ++i) peer->send(frame);
  }
  link.receive(*bus, ms(0));
  EXPECT_FALSE(link.corrupt());
  EXPECT_EQ(link.framesRejected(), 9u);
}

TEST(TruckLink, AFrameOf29BitsIsNobodysWhateverItsNumber) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), peer = hub.connect();
  TruckLink link(0.06);
  for (can::Frame frame :
       {*can::encode(can::TruckFeedbackFrame()), *can::encode(can::TruckCommandFrame())}) {
    frame.extended = true;
    peer->send(frame);
  }
  EXPECT_FALSE(link.receive(*bus, ms(0)));
  EXPECT_FALSE(link.foreignSender());
  EXPECT_EQ(link.framesRejected(), 2u);
}

TEST(TruckLink, ARepeatedFrameIsRejected) {
  const can::Frame frames[] = {
      *can::encode(can::TruckFeedbackFrame()), *can::encode(can::TruckMotionFrame()),
      *can::encode(can::TruckStatusFrame()),   *can::encode(can::OperatorFrame()),
      *can::encode(can::Coils1Frame()),        *can::encode(can::Coils2Frame())};
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), peer = hub.connect();
  TruckLink link(0.06);
  for (const can::Frame& frame : frames) {
    peer->send(frame);
    peer->send(frame);
  }
  link.receive(*bus, ms(0));
  EXPECT_EQ(link.framesReceived(), 12u);
  EXPECT_EQ(link.framesRejected(), 6u);
}

TEST(TruckLink, IsOldUntilAllThreeFramesCame) {
  const can::Frame frames[] = {*can::encode(can::TruckFeedbackFrame()),
                               *can::encode(can::TruckMotionFrame()),
                               *can::encode(can::TruckStatusFrame())};
  for (std::size_t missing = 0; missing < 3; ++missing) {
    can::MemoryBusHub hub;
    const auto bus = hub.connect(), peer = hub.connect();
    TruckLink link(0.06);
    for (std::size_t i = 0; i < 3; ++i) {
      if (i != missing) peer->send(frames[i]);
    }
    link.receive(*bus, ms(0));
    EXPECT_TRUE(std::isinf(link.age(ms(0)))) << missing;
  }
}

TEST(TruckLink, IsAsOldAsTheOldestOfTheThree) {
  const can::Frame frames[] = {*can::encode(can::TruckFeedbackFrame()),
                               *can::encode(can::TruckMotionFrame()),
                               *can::encode(can::TruckStatusFrame())};
  for (std::size_t first = 0; first < 3; ++first) {
    can::MemoryBusHub hub;
    const auto bus = hub.connect(), peer = hub.connect();
    TruckLink link(0.06);
    for (std::size_t i = 0; i < 3; ++i) {  // each comes just after the call at 1000, 1010, 1020 ms
      link.receive(*bus, ms(static_cast<int>(1000 + 10 * i)));
      peer->send(frames[(first + i) % 3]);
    }
    link.receive(*bus, ms(1030));
    EXPECT_NEAR(link.age(ms(1040)), 0.040, 1e-12) << first;
  }
}

TEST(TruckLink, AfterAClockThatJumpedEachOfTheThreeMustComeAnew) {
  for (std::size_t missing = 0; missing < 4; ++missing) {
    can::MemoryBusHub hub;
    const auto bus = hub.connect(), peer = hub.connect();
    TruckLink link(0.06);
    const auto send = [&](std::uint8_t counter, std::size_t but) {
      can::TruckFeedbackFrame feedback;
      can::TruckMotionFrame motion;
      can::TruckStatusFrame status;
      feedback.counter = motion.counter = status.counter = counter;
      if (but != 0) peer->send(*can::encode(feedback));
      if (but != 1) peer->send(*can::encode(motion));
      if (but != 2) peer->send(*can::encode(status));
    };
    send(1, 3);
    link.receive(*bus, ms(100000));
    link.forgetTime();
    EXPECT_TRUE(std::isinf(link.age(ms(5000))));
    send(2, missing);
    link.receive(*bus, ms(5000));
    if (missing < 3) {
      EXPECT_TRUE(std::isinf(link.age(ms(5000)))) << missing;
    } else {
      EXPECT_NEAR(link.age(ms(5010)), 0.010, 1e-12) << "no call of the other time counts";
    }
  }
}

TEST(TruckLink, NeverTellsAnAgeTooYoung) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), peer = hub.connect();
  TruckLink link(0.06);
  link.receive(*bus, ms(0));
  EXPECT_TRUE(std::isinf(link.age(ms(0))));
  peer->send(*can::encode(can::TruckFeedbackFrame()));  // at any time between the two calls
  peer->send(*can::encode(can::TruckMotionFrame()));
  peer->send(*can::encode(can::TruckStatusFrame()));
  EXPECT_TRUE(link.receive(*bus, ms(20)));
  EXPECT_NEAR(link.age(ms(20)), 0.020, 1e-12);
  EXPECT_TRUE(link.fresh(ms(60)));
  EXPECT_FALSE(link.fresh(ms(61)));
}

TEST(TruckLink, FloodCannotHoldTheBridge) {
  can::MemoryBusHub hub;
  const auto bus = hub.connect(), flood = hub.connect();
  TruckLink link(0.06);
  can::Frame frame;
  frame.id = 0x7FF;
  for (int i = 0; i < 1000; ++i) flood->send(frame);
  link.receive(*bus, ms(0));
  EXPECT_EQ(link.framesReceived(), 256u);
  EXPECT_EQ(link.framesRejected(), 256u);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
