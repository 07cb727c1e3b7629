#include "tunnel_pilot/simulation/truck_controller.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/vehicle/dynamic_truck.h"

namespace tunnel_pilot::simulation {
namespace {

using State = TruckController::State;

constexpr double kDeg = 3.14159265358979323846 / 180.0;

std::string configFile(const std::string& name) {
  return std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name;
}
Stamp ms(double milliseconds) { return fromSeconds(milliseconds * 1e-3); }

// The controller with the dynamic truck behind it and a pilot made of hand-written frames before it.
class TruckControllerTest : public testing::Test {
 protected:
  TruckControllerTest()
      : truck_bus(hub.connect()),
        pilot_bus(hub.connect()),
        controller(loadTruckController(config::loadFile(configFile("truck_controller.yaml"))),
                   *truck_bus),
        plant(vehicle::loadTruck(configFile("truck.yaml")), flat()) {
    plant.reset(geometry::Pose(), 0.0, 0.0);
    command.acceleration = 0.8;
  }

  static vehicle::DynamicTruckOptions flat() {
    vehicle::DynamicTruckOptions options;
    options.rough_road = false;
    return options;
  }

  void run(
      double seconds, const std::function<bool()>& until = [] { return false; }) {
    const Stamp end = now + fromSeconds(seconds);
    while (now < end && !until()) {
      now += ms(1);
      if (pilot_alive && now >= next_command) sendCommand(), next_command = now + ms(20);
      const vehicle::PlantState& s = plant.state();
      const SensedTruck sensed{s.articulation, s.articulation_rate, s.speed, s.speed,
                               s.yaw_rate,     s.acceleration,      35000.0, coils};
      controller.setOperator(cab);
      input = controller.step(sensed, now);
      plant.step(input, surroundings, 1e-3);
      while (const auto frame = pilot_bus->receive()) received[frame->id].push_back(*frame);
    }
  }

  void sendCommand() {
    command.counter = counter = can::nextCounter(counter);
    can::Frame frame = *can::encode(command);
    if (tamper) tamper(frame);
    pilot_bus->send(frame);
  }

  void obey(double speed = 0.0) {
    command.steering_enable = false;
    run(0.1);
    command.steering_enable = true;
    command.speed = speed;
    run(30.0,
        [&] { return controller.state() == State::kObeying && plant.state().speed > 0.98 * speed; });
    ASSERT_EQ(controller.state(), State::kObeying);
  }

  template <class Fields>
  Fields last(std::uint32_t id) {
    return *can::decode<Fields>(received[id].back());
  }

  can::MemoryBusHub hub;
  std::unique_ptr<can::Bus> truck_bus, pilot_bus;
  TruckController controller;
  vehicle::DynamicTruck plant;
  vehicle::PlantSurroundings surroundings;
  vehicle::PlantInput input;
  Stamp now = fromSeconds(77.7), next_command = now;
  can::TruckCommandFrame command;
  std::uint8_t counter = 0;
  bool pilot_alive = true;
  std::function<void(can::Frame&)> tamper;
  OperatorInputs cab;
  std::optional<std::array<double, 7>> coils;
  std::map<std::uint32_t, std::vector<can::Frame>> received;
};

TEST_F(TruckControllerTest, ShippedFileRefusesAnUnknownKey) {
  YAML::Node yaml = YAML::LoadFile(configFile("truck_controller.yaml"));
  EXPECT_NO_THROW(loadTruckController(config::Node(yaml, "x")));
  yaml["typo"] = 1;
  EXPECT_THROW(loadTruckController(config::Node(yaml, "x")), config::ConfigError);
}

TEST_F(TruckControllerTest, StandsBrakedUntilAFrameWithoutSteeringWasSeen) {
  command.steering_enable = true;
  command.speed = 3.0;
  run(3.0);
  EXPECT_EQ(controller.state(), State::kReady);
  EXPECT_NEAR(plant.state().speed, 0.0, 1e-3);
  obey(1.0);
  EXPECT_GT(plant.state().speed, 0.9);
}

TEST_F(TruckControllerTest, RestartedItObeysNobodyUntilAFrameWithoutSteeringWasSeen) {
  obey(3.0);
  ASSERT_EQ(controller.state(), State::kObeying);
  controller.restart();
  run(3.0);
  EXPECT_EQ(controller.state(), State::kReady);
  EXPECT_NEAR(plant.state().speed, 0.0, 1e-3);
  obey(1.0);
  EXPECT_EQ(controller.state(), State::kObeying);
}

TEST_F(TruckControllerTest, FollowsTheCommandedSpeedWithinItsAcceleration) {
  obey();
  command.speed = 5.0;
  double fastest = 0.0, sharpest = 0.0;
  for (int i = 0; i < 250; ++i) {
    run(0.1);
    fastest = std::max(fastest, plant.state().speed);
    sharpest = std::max(sharpest, input.acceleration);
  }
  EXPECT_NEAR(plant.state().speed, 5.0, 0.05);
  EXPECT_LT(fastest, 5.35) << "overshoot";
  EXPECT_LE(sharpest, 0.8);
}

TEST_F(TruckControllerTest, HoldsTheSpeedOnAGrade) {
  obey(3.0);
  for (const double percent : {5.0, -10.0}) {
    surroundings.grade = std::atan(percent / 100.0);
    run(25.0);
    EXPECT_NEAR(plant.state().speed, 3.0, 0.1) << percent;
  }
}

TEST_F(TruckControllerTest, SlowsDownGentlyWithASmallCommandedAcceleration) {
  obey(5.0);
  run(5.0);
  command.speed = 2.0;
  command.acceleration = 0.5;
  const Stamp start = now;
  run(20.0, [&] { return plant.state().speed < 2.2; });
  EXPECT_NEAR(toSeconds(now - start), 3.0 / 0.5, 1.2);
}

TEST_F(TruckControllerTest, StandsStillOnAGradeAtSpeedZero) {
  surroundings.grade = std::atan(0.12);
  obey();
  run(10.0);
  EXPECT_LT(std::abs(plant.state().speed), 0.01);
  EXPECT_LT(std::hypot(plant.state().pose.x, plant.state().pose.y), 0.2);
}

TEST_F(TruckControllerTest, StartsOnASlopeWithoutRollingBackFar) {
  surroundings.grade = std::atan(0.05);
  obey();
  double lowest = 0.0;
  command.speed = 2.0;
  run(30.0, [&] {
    lowest = std::min(lowest, plant.state().speed);
    return plant.state().speed > 1.9;
  });
  EXPECT_GT(plant.state().speed, 1.9);
  EXPECT_GT(lowest, -0.3);
}

TEST_F(TruckControllerTest, StopBitBrakesWithTheServiceBrakeWhileSteering) {
  obey(5.0);
  run(3.0);
  const double speed = plant.state().speed;
  command.stop = true;
  command.articulation_angle = 5.0 * kDeg;
  const Stamp start = now;
  run(10.0, [&] { return plant.state().speed < 0.02; });
  const double deceleration = speed / (toSeconds(now - start) - 0.35);  // less the brake's lag
  EXPECT_GT(deceleration, 1.8);
  EXPECT_LT(deceleration, 2.5);
  EXPECT_NEAR(plant.state().articulation, 5.0 * kDeg, 0.5 * kDeg);
}

TEST_F(TruckControllerTest, SilenceOfOneHundredMillisecondsBrakesHoldingTheArticulation) {
  obey(3.0);
  command.articulation_angle = 30.0 * kDeg;
  run(1.0);
  run(0.02, [&] { return next_command == now + ms(20); });
  pilot_alive = false;
  const Stamp silent = now;
  run(0.2, [&] { return controller.state() == State::kFailed; });
  EXPECT_NEAR(toSeconds(now - silent), 0.101, 0.0015);
  const double held = plant.state().articulation;
  run(6.0);
  EXPECT_NEAR(plant.state().speed, 0.0, 1e-3);
  EXPECT_NEAR(plant.state().articulation, held, 6.0 * kDeg)
      << "what dead time and lag still let through";
  EXPECT_LT(plant.state().articulation, 25.0 * kDeg);
  EXPECT_EQ(last<can::TruckStatusFrame>(can::kTruckStatusId).faults, can::kFaultCommandTimeout);
  EXPECT_TRUE(last<can::TruckFeedbackFrame>(can::kTruckFeedbackId).fault);
}

TEST_F(TruckControllerTest, FailureEndsOnlyAtStandstillWithFramesThatDoNotSteer) {
  obey(3.0);
  pilot_alive = false;
  run(0.2);
  pilot_alive = true;  // comes back and goes on as if nothing had been
  run(6.0);
  EXPECT_EQ(controller.state(), State::kFailed);
  EXPECT_NEAR(plant.state().speed, 0.0, 1e-3);
  command.steering_enable = false;
  run(0.1);
  EXPECT_EQ(controller.state(), State::kReady);
  EXPECT_EQ(controller.faults(), 0);
}

TEST_F(TruckControllerTest, ThreeCorruptCommandsInTenBrake) {
  obey(3.0);
  int count = 0;
  tamper = [&](can::Frame& f) {
    if (++count % 3 == 0) f.data[3] ^= 4;
  };
  run(0.5, [&] { return controller.state() == State::kFailed; });
  EXPECT_EQ(controller.state(), State::kFailed);
  EXPECT_EQ(controller.faults(), can::kFaultCommandCorrupt);
}

TEST_F(TruckControllerTest, OneCorruptCommandInTenIsDiscarded) {
  obey(3.0);
  int count = 0;
  tamper = [&](can::Frame& f) {
    if (++count % 10 == 0) f.data[3] ^= 4;
  };
  run(10.0);
  EXPECT_EQ(controller.state(), State::kObeying);
  EXPECT_GT(controller.framesRejected(), 40u);
}

TEST_F(TruckControllerTest, ReplayedCommandBrakes) {
  obey(3.0);
  pilot_alive = false;
  const can::Frame replay = *can::encode(command);
  for (int i = 0; i < 10; ++i) pilot_bus->send(replay), run(0.02);
  EXPECT_EQ(controller.state(), State::kFailed);
}

TEST_F(TruckControllerTest, KeyAtManualObeysNothing) {
  obey(3.0);
  cab.key = can::OperatorKey::kManual;
  run(0.02);
  EXPECT_EQ(controller.state(), State::kManual);
  const auto feedback = last<can::TruckFeedbackFrame>(can::kTruckFeedbackId);
  EXPECT_FALSE(feedback.autonomy_enabled);
  EXPECT_FALSE(feedback.operator_enable);
  cab.throttle = 0.0;
  command.speed = 6.0;
  run(1.0);
  EXPECT_LE(input.acceleration, 0.0);
}

TEST_F(TruckControllerTest, OperatorTakesOverByWheelOrBrakeUntilTheKeyIsTurned) {
  for (const bool wheel : {true, false}) {
    cab = OperatorInputs();
    cab.key = can::OperatorKey::kManual;
    run(8.0);
    cab.key = can::OperatorKey::kAutonomous;
    obey(1.0);
    (wheel ? cab.steering_wheel : cab.brake) = wheel ? 6.0 * kDeg : 0.1;
    run(0.02);
    EXPECT_EQ(controller.state(), State::kOverridden);
    EXPECT_TRUE(last<can::TruckFeedbackFrame>(can::kTruckFeedbackId).operator_override);
    cab.steering_wheel = cab.brake = 0.0;
    command.steering_enable = false;
    run(0.2);
    command.steering_enable = true;
    run(1.0);
    EXPECT_EQ(controller.state(), State::kOverridden) << "no automatic return";
    cab.key = can::OperatorKey::kManual;
    run(0.02);
    EXPECT_EQ(controller.state(), State::kManual);
  }
}

TEST_F(TruckControllerTest, InjectedFaultBrakesAndIsTold) {
  obey(3.0);
  controller.setFaults(can::kFaultSteering);
  run(5.0);
  EXPECT_EQ(controller.state(), State::kFailed);
  EXPECT_NEAR(plant.state().speed, 0.0, 1e-3);
  EXPECT_EQ(last<can::TruckStatusFrame>(can::kTruckStatusId).faults, can::kFaultSteering);
}

TEST_F(TruckControllerTest, SendsItsFramesAtFiftyHertzWithCountersInStep) {
  run(0.1);
  received.clear();
  run(2.0);
  EXPECT_EQ(received.size(), 4u) << "no coils, no coil frames";
  for (const std::uint32_t id :
       {can::kTruckFeedbackId, can::kTruckMotionId, can::kTruckStatusId, can::kOperatorId}) {
    EXPECT_NEAR(static_cast<double>(received[id].size()), 100.0, 1.0);
    can::StreamCheck check;
    for (const can::Frame& frame : received[id]) EXPECT_TRUE(check.accept(frame.data[1] & 0x0F));
  }
}

TEST_F(TruckControllerTest, TellsWhatItsSensorsTell) {
  coils = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7};
  cab.steering_wheel_rate = 0.5;
  plant.reset(geometry::Pose(), 10.0 * kDeg, 2.0);
  run(0.1);
  const auto feedback = last<can::TruckFeedbackFrame>(can::kTruckFeedbackId);
  EXPECT_NEAR(feedback.articulation_angle, 10.0 * kDeg, 0.1 * kDeg);
  EXPECT_NEAR(last<can::TruckMotionFrame>(can::kTruckMotionId).front_axle_speed, feedback.speed, 0.0051);
  EXPECT_NEAR(last<can::TruckMotionFrame>(can::kTruckMotionId).yaw_rate, plant.state().yaw_rate, 0.02);
  EXPECT_EQ(last<can::TruckStatusFrame>(can::kTruckStatusId).payload, 35000.0);
  EXPECT_GT(last<can::TruckStatusFrame>(can::kTruckStatusId).brake_pressure, 1e6) << "ready: it brakes";
  EXPECT_NEAR(last<can::OperatorFrame>(can::kOperatorId).steering_wheel_rate, 0.5, 0.001);
  EXPECT_NEAR(last<can::Coils1Frame>(can::kCoils1Id).coils[3], 0.4, 1e-4);
  EXPECT_NEAR(last<can::Coils2Frame>(can::kCoils2Id).coils[2], 0.7, 1e-4);
}

TEST_F(TruckControllerTest, SensorThatIsNotANumberIsNotSent) {
  run(0.1);
  received.clear();
  for (int i = 1; i <= 5; ++i) {
    SensedTruck broken;
    broken.articulation = std::nan("");
    controller.step(broken, now += ms(20));
  }
  while (const auto frame = pilot_bus->receive()) received[frame->id].push_back(*frame);
  EXPECT_EQ(received.count(can::kTruckFeedbackId), 0u);
  EXPECT_GT(received[can::kTruckMotionId].size(), 3u);
}

}  // namespace
}  // namespace tunnel_pilot::simulation
