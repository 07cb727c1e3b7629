#include "tunnel_pilot/can/layout.h"

namespace tunnel_pilot::can {
namespace {

// Crc and AliveCounter open every frame; the codec takes the signals behind them in this order.
FrameLayout frame(std::uint32_t id, const char* name, std::uint8_t data_id,
                  const std::vector<SignalLayout>& payload) {
  FrameLayout layout{id,
                     name,
                     data_id,
                     {{"Crc", 0, 8, false, 1, 0, 255, ""}, {"AliveCounter", 8, 4, false, 1, 0, 14, ""}}};
  layout.signals.insert(layout.signals.end(), payload.begin(), payload.end());
  return layout;
}

FrameLayout tpCommand() {
  return frame(kTpCommandId, "TP_COMMAND", 0x10,
               {{"SteeringEnable", 12, 1, false, 1, 0, 1, ""},
                {"Stop", 13, 1, false, 1, 0, 1, ""},
                {"Mode", 14, 2, false, 1, 0, 3, ""},
                {"ArticulationAngle", 16, 16, true, 0.01, -45, 45, "deg"},
                {"Speed", 32, 16, true, 0.001, -12, 12, "m/s"},
                {"Acceleration", 48, 8, false, 0.025, 0, 5, "m/s^2"},
                {"Reason", 56, 8, false, 1, 0, 255, ""}});
}

FrameLayout tpCommandInfo() {
  return frame(kTpCommandInfoId, "TP_COMMAND_INFO", 0x11,
               {{"Source", 12, 4, false, 1, 0, 15, ""},
                {"MeasurementStamp", 16, 16, false, 1, 0, 65535, "ms"},
                {"Sequence", 32, 32, false, 1, 0, 4294967295.0, ""}});
}

FrameLayout tpStatus() {
  return frame(kTpStatusId, "TP_STATUS", 0x12,
               {{"State", 12, 4, false, 1, 0, 6, ""},
                {"Reason", 16, 8, false, 1, 0, 255, ""},
                {"FeedbackAge", 24, 8, false, 1, 0, 255, "ms"},
                {"FramesRejected", 32, 16, false, 1, 0, 65535, ""},
                {"CommandsRejected", 48, 16, false, 1, 0, 65535, ""}});
}

FrameLayout truckFeedback() {
  return frame(kTruckFeedbackId, "TRUCK_FEEDBACK", 0x20,
               {{"AutonomyEnabled", 12, 1, false, 1, 0, 1, ""},
                {"OperatorEnable", 13, 1, false, 1, 0, 1, ""},
                {"OperatorOverride", 14, 1, false, 1, 0, 1, ""},
                {"Fault", 15, 1, false, 1, 0, 1, ""},
                {"ArticulationAngle", 16, 16, true, 0.01, -60, 60, "deg"},
                {"ArticulationRate", 32, 16, true, 0.01, -90, 90, "deg/s"},
                {"Speed", 48, 16, true, 0.001, -15, 15, "m/s"}});
}

FrameLayout truckMotion() {
  return frame(kTruckMotionId, "TRUCK_MOTION", 0x21,
               {{"FrontAxleSpeed", 12, 12, true, 0.01, -15, 15, "m/s"},
                {"RearAxleSpeed", 24, 12, true, 0.01, -15, 15, "m/s"},
                {"Acceleration", 36, 12, true, 0.01, -20, 20, "m/s^2"},
                {"YawRate", 48, 16, true, 0.005, -150, 150, "deg/s"}});
}

FrameLayout truckStatus() {
  return frame(kTruckStatusId, "TRUCK_STATUS", 0x22,
               {{"OperatorKey", 12, 2, false, 1, 0, 2, ""},
                {"Faults", 16, 16, false, 1, 0, 65535, ""},
                {"Payload", 32, 16, false, 2, 0, 100000, "kg"},
                {"BrakePressure", 48, 16, false, 0.5, 0, 30000, "kPa"}});
}

FrameLayout operatorInputs() {
  return frame(kOperatorId, "OPERATOR", 0x23,
               {{"SteeringWheel", 16, 16, true, 0.1, -1080, 1080, "deg"},
                {"SteeringWheelRate", 32, 16, true, 0.1, -1500, 1500, "deg/s"},
                {"Throttle", 48, 8, false, 0.5, 0, 100, "%"},
                {"Brake", 56, 8, false, 0.5, 0, 100, "%"}});
}

FrameLayout coils1() {
  return frame(kCoils1Id, "COILS_1", 0x24,
               {{"Coil1", 12, 12, false, 0.00025, 0, 1, ""},
                {"Coil2", 24, 12, false, 0.00025, 0, 1, ""},
                {"Coil3", 36, 12, false, 0.00025, 0, 1, ""},
                {"Coil4", 48, 12, false, 0.00025, 0, 1, ""}});
}

FrameLayout coils2() {
  return frame(kCoils2Id, "COILS_2", 0x25,
               {{"Coil5", 12, 12, false, 0.00025, 0, 1, ""},
                {"Coil6", 24, 12, false, 0.00025, 0, 1, ""},
                {"Coil7", 36, 12, false, 0.00025, 0, 1, ""}});
}

}  // namespace

const std::vector<FrameLayout>& frameLayouts() {
  static const std::vector<FrameLayout> layouts = {tpCommand(),      tpCommandInfo(), tpStatus(),
                                                   truckFeedback(),  truckMotion(),   truckStatus(),
                                                   operatorInputs(), coils1(),        coils2()};
  return layouts;
}

const FrameLayout* findLayout(std::uint32_t id) {
  for (const FrameLayout& layout : frameLayouts()) {
    if (layout.id == id) return &layout;
  }
  return nullptr;
}

}  // namespace tunnel_pilot::can
