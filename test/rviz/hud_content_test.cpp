// What the HUD shows of what was heard, and how old it may be.
#include "tunnel_pilot/rviz/hud_content.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tunnel_pilot::hud {
namespace {

constexpr double kRadians = M_PI / 180.0;

// Both clocks so many seconds after the messages of drivingInput() were measured and heard.
Moment after(double seconds) { return {ros::Time(100.0 + seconds), ros::SteadyTime(5.0 + seconds)}; }

template <class Message>
void hear(const Message& message, Heard<Message>& heard) {
  Message stamped = message;
  stamped.header.stamp = after(0.0).time;
  heard.set(stamped, after(0.0));
}

TruckStatus truckIn(std::uint8_t state, const std::string& reason) {
  TruckStatus truck;
  truck.state = state;
  truck.reason_text = reason;
  return truck;
}

ArbiterState drivingArbiter() {
  ArbiterState arbiter;
  arbiter.source = TruckCommand::SOURCE_LIDAR_DRIVER;
  arbiter.reason_text = "driving as asked";
  arbiter.speed_limit = 7.0;
  arbiter.limited_by = "lateral_acceleration";
  return arbiter;
}

TruckCommand drivingCommand() {
  TruckCommand command;
  command.mode = TruckCommand::MODE_AUTONOMOUS;
  command.speed = 2.5;
  command.articulation_angle = 12.0 * kRadians;
  return command;
}

sensor_msgs::JointState articulation(double angle) {
  sensor_msgs::JointState joints;
  joints.name = {"wheel", "articulation_joint"};
  joints.position = {9.0, angle};
  return joints;
}

TunnelState tunnelAt(double lateral_offset, double heading_error) {
  TunnelState tunnel;
  tunnel.valid = true;
  tunnel.lateral_offset = lateral_offset;
  tunnel.heading_error = heading_error;
  return tunnel;
}

Proposal networkProposal() {
  Proposal network;
  network.valid = true;
  network.articulation_angle = 15.0 * kRadians;
  network.confidence = 0.875;
  network.outputs.assign(31, 0.0F);
  network.outputs[20] = 0.5F;
  network.outputs_first = -45.0 * kRadians;
  network.outputs_spacing = 3.0 * kRadians;
  network.model = "lidar_driver 0123456789abcdef0123456789abcdef";
  return network;
}

nav_msgs::Odometry moving(double speed) {
  nav_msgs::Odometry odometry;
  odometry.twist.twist.linear.x = speed;
  return odometry;
}

HudInput drivingInput() {
  HudInput input;
  hear(truckIn(TruckStatus::STATE_ACTIVE, "driving as asked"), input.truck);
  hear(drivingArbiter(), input.arbiter);
  hear(drivingCommand(), input.command);
  hear(articulation(10.0 * kRadians), input.joints);
  hear(tunnelAt(0.25, -5.0 * kRadians), input.tunnel);
  hear(networkProposal(), input.network);
  hear(moving(2.25), input.odometry);
  return input;
}

HudContent driving() { return describeHud(drivingInput(), after(0.04)); }

void expectText(const char* text, Tone tone, const Text& shown) {
  EXPECT_EQ(text, shown.text);
  EXPECT_EQ(tone, shown.tone) << text;
}

TEST(HudState, OfADriveIsGreenWithItsModeAndReason) {
  expectText("ACTIVE", Tone::kGood, driving().state);
  expectText("autonomous", Tone::kNormal, driving().mode);
  expectText("driving as asked", Tone::kGood, driving().reason);
}

TEST(HudState, OfAStopIsRedForTheBridgesReason) {
  auto input = drivingInput();
  hear(truckIn(TruckStatus::STATE_STOPPED, "CAN bus fault"), input.truck);
  const auto content = describeHud(input, after(0.0));
  expectText("STOPPED", Tone::kAlarm, content.state);
  expectText("CAN bus fault", Tone::kAlarm, content.reason);
}

TEST(HudState, InDegradedIsAmber) {
  auto input = drivingInput();
  hear(truckIn(TruckStatus::STATE_DEGRADED, ""), input.truck);
  expectText("DEGRADED", Tone::kCaution, describeHud(input, after(0.0)).state);
}

TEST(HudState, InStandbyIsNeitherGreenNorRed) {
  auto input = drivingInput();
  hear(truckIn(TruckStatus::STATE_STANDBY, ""), input.truck);
  expectText("STANDBY", Tone::kStandby, describeHud(input, after(0.0)).state);
}

TEST(HudState, OfASilentBridgeIsNoData) {
  auto input = drivingInput();
  input.arbiter = {};
  const auto content = describeHud(input, after(2.1));
  expectText("NO DATA", Tone::kStale, content.state);
  expectText("nothing is heard of the pilot", Tone::kStale, content.reason);
}

TEST(HudState, OfASilentBridgeIsNotReplacedByTheMode) {
  auto input = drivingInput();
  const auto later = after(2.1);
  input.arbiter.set(drivingArbiter(), later);
  input.command.set(drivingCommand(), later);
  EXPECT_EQ("NO DATA", describeHud(input, later).state.text);
}

TEST(HudState, OfATruckWithoutOurBridgeIsItsMode) {
  auto input = drivingInput();
  input.truck = {};
  expectText("AUTONOMOUS", Tone::kGood, describeHud(input, after(0.0)).state);
}

TEST(HudState, NobodyHeardIsNoDataEverywhere) {
  const auto content = describeHud({}, after(0.0));
  for (const auto* text :
       {&content.source, &content.speed, &content.articulation, &content.lateral, &content.heading,
        &content.network_angle, &content.scan_age, &content.feedback_age}) {
    expectText("no data", Tone::kStale, *text);
  }
  expectText("no command", Tone::kStale, content.asked_speed);
  expectText("no command", Tone::kStale, content.commanded);
}

TEST(HudSource, IsToldInWords) { expectText("lidar driver", Tone::kNormal, driving().source); }

TEST(HudSpeed, StandsBesideWhatIsAskedAndWhatHoldsIt) {
  expectText("2.25 m/s", Tone::kNormal, driving().speed);
  expectText("asked 2.50 m/s", Tone::kNormal, driving().asked_speed);
  expectText("by lateral acceleration", Tone::kNormal, driving().limited_by);
  expectText("limit 7.00", Tone::kNormal, driving().speed_limit);
}

TEST(HudSpeed, BarIsAShareOfTenMetresASecond) {
  EXPECT_DOUBLE_EQ(0.23, driving().speed_gauge.value.value());
  EXPECT_DOUBLE_EQ(0.25, driving().speed_gauge.mark.value());
}

TEST(HudSpeed, StandingIsNeverMinusZero) {
  auto input = drivingInput();
  hear(moving(-0.001), input.odometry);
  EXPECT_EQ("0.00 m/s", describeHud(input, after(0.0)).speed.text);
}

TEST(HudSpeed, ThatIsNoNumberHasNoBar) {
  auto input = drivingInput();
  hear(moving(std::numeric_limits<double>::quiet_NaN()), input.odometry);
  EXPECT_FALSE(describeHud(input, after(0.0)).speed_gauge.value.has_value());
}

TEST(HudArticulation, IsMeasuredBesideItsCommand) {
  expectText("+10.0°", Tone::kNormal, driving().articulation);
  expectText("asked +12.0°", Tone::kNormal, driving().commanded);
  EXPECT_DOUBLE_EQ(0.22, driving().articulation_gauge.value.value());
  EXPECT_DOUBLE_EQ(0.27, driving().articulation_gauge.mark.value());
}

TEST(HudArticulation, OfOtherJointsIsNoData) {
  auto input = drivingInput();
  sensor_msgs::JointState joints;
  joints.name = {"wheel"};
  joints.position = {1.0};
  hear(joints, input.joints);
  expectText("no data", Tone::kStale, describeHud(input, after(0.0)).articulation);
}

TEST(HudTunnel, TellsOffsetAndHeadingInTheirScales) {
  EXPECT_EQ("", driving().no_tunnel.text);
  expectText("+0.25 m", Tone::kNormal, driving().lateral);
  expectText("-5.0°", Tone::kNormal, driving().heading);
  EXPECT_DOUBLE_EQ(0.25, driving().lateral_gauge.value.value());
  EXPECT_DOUBLE_EQ(-0.5, driving().heading_gauge.value.value());
}

TEST(HudTunnel, ThatIsNotValidShowsNoNumbers) {
  auto input = drivingInput();
  TunnelState none = tunnelAt(0.25, 0.0);
  none.valid = false;
  none.reason = TunnelState::REASON_NO_WALLS;
  hear(none, input.tunnel);
  const auto content = describeHud(input, after(0.0));
  expectText("no tunnel: no walls found", Tone::kCaution, content.no_tunnel);
  EXPECT_FALSE(content.lateral_gauge.value.has_value());
}

TEST(HudNetwork, TellsAngleConfidenceAndModel) {
  expectText("+15.0°", Tone::kNormal, driving().network_angle);
  expectText("confidence 0.88", Tone::kNormal, driving().confidence);
  expectText("lidar_driver", Tone::kNormal, driving().model);
  expectText("0123456789ab", Tone::kNormal, driving().hash);
}

TEST(HudNetwork, ShowsAllOutputsAndWhereTheyAreDecoded) {
  ASSERT_EQ(31u, driving().outputs.size());
  EXPECT_DOUBLE_EQ(0.5, driving().outputs[20]);
  EXPECT_DOUBLE_EQ(0.33, driving().network_gauge.value.value());  // 15 of 45 degrees
}

TEST(HudNetwork, MarksWhereThePreviewDriverWouldSteer) {
  EXPECT_FALSE(driving().network_gauge.mark.has_value());
  auto input = drivingInput();
  Proposal preview;
  preview.valid = true;
  preview.articulation_angle = -9.0 * kRadians;
  hear(preview, input.preview);
  EXPECT_DOUBLE_EQ(-0.2, describeHud(input, after(0.0)).network_gauge.mark.value());
}

TEST(HudNetwork, ThatRefusesShowsItsOutputsButNoAngle) {
  auto input = drivingInput();
  Proposal refused = networkProposal();
  refused.valid = false;
  hear(refused, input.network);
  const auto content = describeHud(input, after(0.0));
  expectText("no proposal", Tone::kCaution, content.network_angle);
  EXPECT_EQ("", content.confidence.text);
  EXPECT_FALSE(content.network_gauge.value.has_value());
  EXPECT_EQ(31u, content.outputs.size());
}

TEST(HudAge, OfHalfASecondTurnsValuesGrey) {
  const auto content = describeHud(drivingInput(), after(0.6));
  expectText("2.25 m/s", Tone::kStale, content.speed);
  expectText("ACTIVE", Tone::kStale, content.state);
  EXPECT_EQ(Tone::kStale, content.reason.tone);
  EXPECT_EQ(Tone::kStale, content.network_gauge.tone);
}

TEST(HudAge, OfTwoSecondsTakesValuesAway) {
  const auto content = describeHud(drivingInput(), after(2.1));
  for (const auto* text : {&content.speed, &content.articulation, &content.lateral, &content.heading,
                           &content.network_angle}) {
    expectText("no data", Tone::kStale, *text);
  }
  expectText("no command", Tone::kStale, content.commanded);
  EXPECT_FALSE(content.speed_gauge.value.has_value());
  EXPECT_FALSE(content.articulation_gauge.mark.has_value());
  EXPECT_TRUE(content.outputs.empty());
}

TEST(HudAge, GrowsBySteadyTimeWhereRosTimeStandsStill) {
  auto input = drivingInput();
  EXPECT_EQ(Tone::kNormal, describeHud(input, {after(0.0).time, after(0.9).steady}).speed.tone);
  EXPECT_EQ(Tone::kStale, describeHud(input, {after(0.0).time, after(1.1).steady}).speed.tone);
  EXPECT_EQ("no data", describeHud(input, {after(0.0).time, after(4.1).steady}).speed.text);
}

TEST(HudAge, IsOfTheMeasurementNotOfItsArrival) {
  auto input = drivingInput();
  auto late = moving(2.25);
  late.header.stamp = after(-0.6).time;
  input.odometry.set(late, after(0.0));
  EXPECT_EQ(Tone::kStale, describeHud(input, after(0.0)).speed.tone);
}

TEST(HudAge, OfADecisionIsOfItsArrival) {
  auto input = drivingInput();
  auto arbiter = drivingArbiter();
  arbiter.header.stamp = ros::Time(0);  // nothing was measured yet
  input.arbiter.set(arbiter, after(0.0));
  EXPECT_EQ(Tone::kNormal, describeHud(input, after(0.0)).source.tone);
}

TEST(HudAge, OfAClockThatWentBackIsNotTrusted) {
  EXPECT_EQ("no data", describeHud(drivingInput(), after(-1.0)).speed.text);
  expectText("-1.0 s", Tone::kAlarm, describeHud(drivingInput(), after(-1.0)).scan_age);
}

TEST(HudAge, OfScanAndFeedbackIsToldInColour) {
  expectText("< 0.1 s", Tone::kNormal, describeHud(drivingInput(), after(0.04)).scan_age);
  expectText("0.2 s", Tone::kCaution, describeHud(drivingInput(), after(0.2)).scan_age);
  expectText("0.4 s", Tone::kAlarm, describeHud(drivingInput(), after(0.4)).feedback_age);
  expectText("30 s", Tone::kAlarm, describeHud(drivingInput(), after(30.0)).feedback_age);
}

TEST(HudContent, OfTheSameLooksDoesNotDiffer) {
  auto input = drivingInput();
  hear(moving(2.2501), input.odometry);
  EXPECT_TRUE(driving() == describeHud(input, after(0.05)));
}

TEST(HudContent, OfOtherLooksDiffers) {
  auto input = drivingInput();
  hear(moving(2.26), input.odometry);
  EXPECT_FALSE(driving() == describeHud(input, after(0.04)));
  EXPECT_FALSE(driving() == describeHud(drivingInput(), after(0.6)));
}

}  // namespace
}  // namespace tunnel_pilot::hud
