#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <optional>
#include <utility>

#include "rig.h"

// What the bridge tells: its status, TP_STATUS, the truck's motion.
namespace tunnel_pilot::bridge {
namespace {

using supervision::Reason;

constexpr double kDeg = 3.14159265358979323846 / 180.0;

class CanBridgeStatus : public testing::Test {
 protected:
  const BridgeStatus& status() const { return rig.bridge->status(); }

  /// The last TP_STATUS; one with a state that there is not, when none came.
  can::BridgeStatusFrame lastFrame() const {
    can::BridgeStatusFrame last;
    last.state = 15;
    for (const can::Frame& frame : rig.log) {
      if (const auto told = can::decode<can::BridgeStatusFrame>(frame)) last = *told;
    }
    return last;
  }

  /// Lets the truck tell something else than it measures.
  template <class Fields>
  void letTruckTell(std::function<void(Fields&)> change) {
    rig.to_bridge = [change = std::move(change)](const can::Frame& frame) {
      auto fields = can::decode<Fields>(frame);
      if (!fields) return std::optional<can::Frame>(frame);
      change(*fields);
      return can::encode(*fields);
    };
  }

  Rig rig;
};

// -------- its status

TEST_F(CanBridgeStatus, TellsOfTheCabsWheelAndPedals) {
  rig.cab.steering_wheel = 1.0;
  rig.cab.throttle = 0.25;
  rig.cab.brake = 0.5;
  rig.run(0.5);
  EXPECT_NEAR(status().steering_wheel, 1.0, 0.001);
  EXPECT_EQ(status().throttle_pedal, 0.25);
  EXPECT_EQ(status().brake_pedal, 0.5);
}

TEST_F(CanBridgeStatus, TellsOfTheOperatorsKeyAndOfHisTakingOver) {
  rig.run(0.1);
  EXPECT_TRUE(status().operator_enable);
  EXPECT_FALSE(status().operator_override);
  rig.cab.brake = 0.5;
  rig.run(0.1);
  EXPECT_TRUE(status().operator_override);
  rig.cab.key = can::OperatorKey::kManual;
  rig.run(0.1);
  EXPECT_FALSE(status().operator_enable);
}

TEST_F(CanBridgeStatus, TellsOfLoadAndBrake) {
  letTruckTell<can::TruckStatusFrame>([](can::TruckStatusFrame& told) {
    told.payload = 15000.0;
    told.brake_pressure = 2.5e6;
  });
  rig.run(0.1);
  EXPECT_EQ(status().payload, 15000.0);
  EXPECT_EQ(status().brake_pressure, 2.5e6);
}

TEST_F(CanBridgeStatus, TellsOfYawRateAndAccelerationAsTheyAreMeasured) {
  letTruckTell<can::TruckMotionFrame>([](can::TruckMotionFrame& told) {
    told.yaw_rate = 3.0 * kDeg;
    told.acceleration = -1.25;
  });
  rig.run(0.1);
  EXPECT_NEAR(status().yaw_rate, 3.0 * kDeg, 1e-9);
  EXPECT_NEAR(status().longitudinal_acceleration, -1.25, 1e-9);
}

TEST_F(CanBridgeStatus, TellsOfAllCoilsInTheirOrder) {
  rig.wire_to_bridge->send(*can::encode(can::Coils1Frame{1, {0.125, 0.25, 0.375, 0.5}}));
  rig.wire_to_bridge->send(*can::encode(can::Coils2Frame{1, {0.625, 0.75, 0.875}}));
  rig.run(0.01);
  const std::array<double, 7> expected = {0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875};
  EXPECT_EQ(status().coils, expected);
}

TEST_F(CanBridgeStatus, TellsOfSteeringThatDoesNotFollow) {
  rig.drive();
  rig.run(1.0);
  EXPECT_EQ(status().tracking_error, 0.0);
  rig.valve_stuck = true;
  rig.command.articulation_angle = 15.0 * kDeg;
  rig.timeToStop();
  EXPECT_GT(status().tracking_error, 5.0 * kDeg);
}

TEST_F(CanBridgeStatus, CountsTheChangesOfItsState) {
  rig.drive();
  EXPECT_EQ(status().transitions, 3u) << "to STANDBY, ARMED and ACTIVE";
}

TEST_F(CanBridgeStatus, CountsTheFramesOfBothWays) {
  rig.run(1.0);
  rig.runToTick();  // which has read all
  std::uint32_t own = 0;
  for (const can::Frame& frame : rig.log) {
    own += frame.id == can::kTpCommandId || frame.id == can::kTpCommandInfoId ||
           frame.id == can::kTpStatusId;
  }
  EXPECT_GE(own, 147u);
  EXPECT_EQ(status().frames_sent, own);
  EXPECT_EQ(status().frames_received, rig.log.size() - own);
}

TEST_F(CanBridgeStatus, AfterAnAcceptedEdgeIsThatOfItsTime) {
  const auto stampAfter = [this](CanBridge::Answer (CanBridge::*edge)(Stamp)) {
    rig.runToTick();
    rig.run(0.002);
    EXPECT_TRUE((*rig.bridge.*edge)(rig.now).accepted);
    return status().stamp;
  };
  rig.run(1.5);
  EXPECT_EQ(stampAfter(&CanBridge::engage), rig.now);
  EXPECT_EQ(stampAfter(&CanBridge::release), rig.now);
  EXPECT_EQ(stampAfter(&CanBridge::stop), rig.now);
  rig.run(1.0);
  EXPECT_EQ(stampAfter(&CanBridge::reset), rig.now);
}

// -------- TP_STATUS

TEST_F(CanBridgeStatus, ItsFrameTellsTheStateAndTheReasonOfItsLastChange) {
  rig.drive();
  EXPECT_EQ(lastFrame().state, static_cast<int>(SafetyState::kActive));
  rig.command.reason = Reason::kScanStale;
  rig.run(0.1);
  EXPECT_EQ(lastFrame().state, static_cast<int>(SafetyState::kDegraded));
  EXPECT_EQ(lastFrame().reason, static_cast<int>(Reason::kScanStale));
}

TEST_F(CanBridgeStatus, ItsFrameTellsTheAgeOfTheTrucksFrames) {
  rig.run(0.5);
  rig.runToSet();
  ASSERT_GT(status().feedback_age, 0.004);
  EXPECT_NEAR(lastFrame().feedback_age, status().feedback_age, 0.00051);
}

TEST_F(CanBridgeStatus, ItsFrameTellsNoHigherAgeThanItCan) {
  rig.run(0.5);
  rig.truck_alive = false;
  rig.run(1.0);
  EXPECT_NEAR(lastFrame().feedback_age, 0.255, 1e-9);
}

TEST_F(CanBridgeStatus, ItsFrameCountsWhatWasRefused) {
  for (std::uint32_t i = 0; i < 3; ++i) rig.bridge->rejectCommand({}, "no number", rig.now);
  for (std::uint32_t i = 0; i < 5; ++i) rig.wire_to_bridge->send(can::Frame());
  rig.run(0.1);
  EXPECT_EQ(lastFrame().commands_rejected, 3);
  EXPECT_EQ(lastFrame().frames_rejected, 5);
}

TEST_F(CanBridgeStatus, ItsFramesCountersStayAtTheHighestThatTheyCanTell) {
  for (std::uint32_t i = 0; i < 65537; ++i) rig.bridge->rejectCommand({}, "no number", rig.now);
  rig.run(0.1);
  EXPECT_EQ(status().commands_rejected, 65537u);
  EXPECT_EQ(lastFrame().commands_rejected, 65535);
}

// -------- motion

TEST_F(CanBridgeStatus, TheMotionReckonsTheWayDriven) {
  rig.drive();
  rig.run(5.0);
  ASSERT_GT(rig.plant.state().pose.x, 15.0);
  EXPECT_NEAR(rig.bridge->motion().pose.x, rig.plant.state().pose.x, 0.15);
}

TEST_F(CanBridgeStatus, WithoutNewsOfTheTruckItsMotionIsNotMadeYounger) {
  rig.drive();
  rig.truck_alive = false;
  rig.run(0.01);
  const Stamp before = rig.bridge->motion().stamp;
  rig.run(0.1);
  EXPECT_EQ(rig.bridge->motion().stamp, before);
}

TEST_F(CanBridgeStatus, TheMotionTurnsByTheGyroWhileThatIsFresh) {
  rig.drive();
  rig.gyro_bias = 3.0 * kDeg;  // it has learned at standstill that there is none
  rig.run(0.1);
  EXPECT_NEAR(rig.bridge->motion().yaw_rate, 3.0 * kDeg, 0.1 * kDeg);
}

TEST_F(CanBridgeStatus, TheMotionTurnsByTheArticulationWithoutAFreshGyro) {
  rig.drive();
  rig.gyro_bias = 3.0 * kDeg;
  rig.run(0.1);
  rig.to_bridge = [](const can::Frame& frame) {
    return frame.id == can::kTruckMotionId ? std::nullopt : std::optional<can::Frame>(frame);
  };
  rig.run(0.2);
  EXPECT_NEAR(rig.bridge->motion().yaw_rate, 0.0, 0.1 * kDeg);
}

}  // namespace
}  // namespace tunnel_pilot::bridge
