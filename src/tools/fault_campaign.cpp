// fault_campaign: the bridge and the truck's controller in virtual time, against seeded faults.
#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/bridge/heartbeat_watch.h"
#include "tunnel_pilot/can/log_writer.h"
#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/can/protection.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/truck_controller.h"
#include "tunnel_pilot/vehicle/kinematic_truck.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;
using bridge::SafetyState;

constexpr double kDeg = 3.14159265358979323846 / 180.0;
constexpr Stamp kCycle = std::chrono::milliseconds(20);
constexpr const char* kProcess = "/arbiter";

struct Setup {
  bridge::BridgeParameters bridge;
  simulation::TruckControllerParameters controller;
  vehicle::TruckParameters truck;
};

// An empty profile is that of the files.
Setup loadSetup(const std::string& folder, const std::string& profile) {
  Setup setup = {bridge::loadBridge(config::loadFile(folder + "/can_bridge.yaml")),
                 simulation::loadTruckController(config::loadFile(folder + "/truck_controller.yaml")),
                 vehicle::loadTruck(folder + "/truck.yaml")};
  if (!profile.empty()) {
    const bool j1939 = profile == toString(can::ProfileKind::kJ1939);
    setup.bridge.can.kind = setup.controller.can.kind =
        j1939 ? can::ProfileKind::kJ1939 : can::ProfileKind::kPlain;
  }
  can::requireAgreement(setup.bridge.can, setup.controller.can);
  return setup;
}

can::Frame j1939Frame(std::uint8_t priority, std::uint32_t pgn, std::uint8_t source, std::uint64_t data,
                      std::uint8_t length = 8) {
  can::Frame frame;
  frame.id = can::toIdentifier({priority, pgn, can::kGlobalAddress, source});
  frame.extended = true;
  frame.length = length;
  for (std::size_t i = 0; i < length; ++i) frame.data[i] = static_cast<std::uint8_t>(data >> 8 * i);
  return frame;
}

/// What a fault does to the traffic and the command while it lasts.
struct Faults {
  bool commands_lost = false;
  bool commands_not_finite = false;
  bool commands_out_of_range = false;
  bool commands_count_back = false;
  bool measurement_frozen = false;
  bool stop_asked = false;  ///< by the arbiter
  bool feedback_lost = false;
  bool feedback_corrupt = false;
  bool counter_stands = false;
  bool truck_deaf = false;  ///< loses every other frame of the pilot's
  bool degraded = false;    ///< the arbiter tells bad health
  bool process_silent = false;
};

constexpr Stamp kToldJump =
    std::chrono::milliseconds(100);  ///< what the shell takes for a jump of the clock

/// Bridge and truck, and between them a wire that a log is kept of. Time is the bus's own; the bridge's
/// clock may jump against it.
class Rig {
 public:
  Rig(const Setup& setup, Stamp start, Stamp tick_period, can::LogWriter* log)
      : now_(start),
        tick_period_(tick_period),
        log_(log),
        profile_(setup.bridge.can),
        bridge_bus_(can::withProfile(profile_, bridge_side_.connect())),
        wire_to_bridge_(bridge_side_.connect()),
        truck_bus_(can::withProfile(setup.controller.can, truck_side_.connect())),
        wire_to_truck_(truck_side_.connect()),
        bridge_(setup.bridge, setup.truck.geometry, *bridge_bus_),
        heartbeats_({kProcess}, setup.bridge.heartbeat_timeout),
        controller_(setup.controller, *truck_bus_),
        plant_(setup.truck),
        next_tick_(start),
        next_command_(start) {
    plant_.reset(geometry::Pose(), 0.0, 0.0);
    command_.speed = 3.0;
    command_.acceleration = 0.8;
    command_.mode = supervision::Mode::kAutonomous;
    command_.source = supervision::Source::kPreviewDriver;
    event("start");
    event("clock 0");
  }

  void step(Stamp dt) {
    now_ += dt;
    moveTruck(toSeconds(dt));
    if (now_ >= next_command_) {
      next_command_ = now_ + kCycle;
      sendCommand();
      beat();
    }
    if (now_ < next_tick_) return;
    next_tick_ = now_ + tick_period_;
    bridge_.setSilentProcess(heartbeats_.silent(now_));
    if (std::exchange(jumped_ahead_, false)) bridge_.clockJumped(clock());
    bridge_.tick(clock());
    carry();
  }

  // -------- the operator's edges

  bool engage() { return edge("engage", bridge_.engage(clock()).accepted); }
  bool reset() { return edge("reset", bridge_.reset(clock()).accepted); }
  void release() {
    event("release");
    edge("", bridge_.release(clock()).accepted);
  }
  void stop() {
    event("stop");
    edge("", bridge_.stop(clock()).accepted);
  }

  // -------- faults that come at once

  /// A frame under an identifier of the pilot's.
  void sendForeign(can::Frame frame) {
    frame.id = onWire(frame.id);
    frame.extended = isJ1939();
    event("foreign " + can::toText(frame));
    if (log_ != nullptr) log_->frame(frame, now_);
    wire_to_bridge_->send(frame);
  }

  /// Any other frame that is neither the pilot's nor the truck's.
  void sendStrange(const can::Frame& frame) {
    if (!bus_passes_) return;
    if (log_ != nullptr) log_->frame(frame, now_);
    wire_to_bridge_->send(frame);
  }

  bool isJ1939() const { return profile_.kind == can::ProfileKind::kJ1939; }
  const can::J1939Parameters& pilot() const { return profile_.j1939; }

  /// As on the truck, it is the next tick that finds it.
  void jumpClock(Stamp by) {
    offset_ += by;
    event("clock " + std::to_string(1e3 * toSeconds(offset_)));
    jumped_ahead_ = jumped_ahead_ || by > kToldJump;
  }

  void setBus(can::BusState state) {
    const bool passes = state != can::BusState::kBusOff && state != can::BusState::kDown;
    if (passes != bus_passes_) event(passes ? "bus up" : "bus down");
    bus_passes_ = passes;
    bridge_side_.setState(state);
  }

  void setFaultBits(std::uint16_t bits) { controller_.setFaults(bits); }

  SafetyState state() const { return bridge_.status().state; }
  Stamp now() const { return now_; }
  double speed() const { return plant_.state().speed; }
  /// Since when every frame has told a stop or no steering.
  std::optional<Stamp> notDrivingSince() const { return not_driving_since_; }

  Faults faults;
  supervision::Command command_;
  simulation::OperatorInputs cab;
  Stamp last_good_feedback{}, last_command{}, last_measurement{}, last_heartbeat{};  ///< bus time

 private:
  Stamp clock() const { return now_ + offset_; }

  void event(const std::string& words) {
    if (log_ != nullptr) log_->event(words, now_);
  }

  bool edge(const char* words, bool accepted) {
    if (accepted && *words != '\0') event(words);
    carry();
    return accepted;
  }

  void moveTruck(double dt) {
    const vehicle::PlantState& state = plant_.state();
    simulation::SensedTruck sensed;
    sensed.articulation = state.articulation;
    sensed.articulation_rate = state.articulation_rate;
    sensed.speed = sensed.rear_axle_speed = state.speed;
    sensed.yaw_rate = state.yaw_rate;
    sensed.acceleration = state.acceleration;
    controller_.setOperator(cab);
    plant_.step(controller_.step(sensed, now_), vehicle::PlantSurroundings(), dt);
    carry();
  }

  void sendCommand() {
    supervision::Command sent = command_;
    if (!faults.measurement_frozen) last_measurement = now_ - std::chrono::milliseconds(60);
    sent.stamp = last_measurement + offset_;
    sent.sequence = ++sequence_;
    if (faults.commands_count_back) sent.sequence = sequence_ / 2;
    if (faults.commands_not_finite) sent.speed = std::numeric_limits<double>::quiet_NaN();
    if (faults.commands_out_of_range) sent.articulation_angle = 1.5;
    if (faults.degraded) sent.reason = supervision::Reason::kLowConfidence;
    sent.stop = faults.stop_asked;
    if (!faults.measurement_frozen)
      event("measurement preview_driver 60");  // though its command is lost
    if (faults.commands_lost) return;
    if (sent.stop) event("command_stop");
    bridge_.setCommand(sent, clock());
    const bool bad =
        faults.commands_count_back || faults.commands_not_finite || faults.commands_out_of_range;
    if (!bad) last_command = now_;
    carry();
  }

  void beat() {
    if (faults.process_silent) return;
    last_heartbeat = now_;
    heartbeats_.heard(kProcess, now_);
  }

  void carry() {
    while (const std::optional<can::Frame> frame = wire_to_bridge_->receive()) {
      if (log_ != nullptr) log_->frame(*frame, now_);
      look(*frame);
      if (faults.truck_deaf && ++deaf_ % 2 == 0) continue;
      wire_to_truck_->send(*frame);
    }
    while (std::optional<can::Frame> frame = wire_to_truck_->receive()) carryToBridge(*frame);
  }

  void carryToBridge(can::Frame frame) {
    if (faults.feedback_lost || !bus_passes_) return;
    if (faults.feedback_corrupt) frame.data[4] ^= 0x10;
    if (frame.id == feedback_id_) {
      if (faults.counter_stands) frame = last_feedback_;
      last_feedback_ = frame;
    }
    if (!faults.feedback_corrupt && !faults.counter_stands) last_good_feedback = now_;
    if (log_ != nullptr) log_->frame(frame, now_);
    wire_to_bridge_->send(frame);
  }

  // The identifier that a frame of the .dbc has on the wire.
  std::uint32_t onWire(std::uint32_t id) const {
    for (const can::J1939Group& group : can::j1939Groups()) {
      if (!isJ1939() || group.id != id) continue;
      const bool pilots = group.sender == can::Side::kPilot;
      const std::uint8_t source = pilots ? pilot().source_address : pilot().partner_address;
      return can::toIdentifier({group.priority, group.pgn, can::kGlobalAddress, source});
    }
    return id;
  }

  void look(can::Frame frame) {
    if (frame.id != command_id_) return;
    frame.id = can::kTpCommandId;
    frame.extended = false;
    const auto command = can::decode<can::TruckCommandFrame>(frame);
    if (!command) return;
    if (command->steering_enable && !command->stop) {
      not_driving_since_.reset();
    } else if (!not_driving_since_) {
      not_driving_since_ = now_;
    }
  }

  Stamp now_, offset_{}, tick_period_;
  bool jumped_ahead_ = false;  ///< since the last tick
  can::LogWriter* log_;
  can::MemoryBusHub bridge_side_, truck_side_;
  can::Profile profile_;
  std::unique_ptr<can::Bus> bridge_bus_, wire_to_bridge_, truck_bus_, wire_to_truck_;
  bridge::CanBridge bridge_;
  bridge::HeartbeatWatch heartbeats_;
  simulation::TruckController controller_;
  vehicle::KinematicTruck plant_;
  Stamp next_tick_, next_command_;
  std::optional<Stamp> not_driving_since_;
  can::Frame last_feedback_;
  std::uint32_t command_id_ = onWire(can::kTpCommandId);
  std::uint32_t feedback_id_ = onWire(can::kTruckFeedbackId);
  std::uint32_t sequence_ = 0;
  unsigned deaf_ = 0;
  bool bus_passes_ = true;
};

// -------- random traffic

/// One drive of random faults, one after the other and over one another.
class Episode {
 public:
  Episode(const Setup& setup, std::uint64_t seed, Stamp start, can::LogWriter* log)
      : random_(seed, simulation::Stream::kFaults),
        rig_(setup, start, std::chrono::milliseconds(tickPeriod()), log) {}

  Stamp run(long long cycles) {
    const Stamp step = std::chrono::milliseconds(5);
    const Stamp end = rig_.now() + cycles * kCycle;
    while (rig_.now() < end) {
      operate();
      misbehave();
      rig_.step(step);
    }
    return rig_.now();
  }

 private:
  double uniform() { return random_.uniform(); }
  bool chance(double per_second) { return uniform() < per_second * 0.005; }
  int below(int count) { return std::min(static_cast<int>(uniform() * count), count - 1); }
  int tickPeriod() {
    static constexpr int kPeriods[] = {5, 10, 20};
    return kPeriods[below(3)];
  }

  void operate() {
    const SafetyState state = rig_.state();
    if (state == SafetyState::kStandby && chance(3.0)) rig_.engage();
    if (state == SafetyState::kStopped && chance(2.0)) rig_.reset();
    if (chance(0.02)) rig_.engage();
    if (chance(0.02)) rig_.release();
    if (chance(0.03)) rig_.stop();
    if (chance(0.02)) rig_.reset();
    if (chance(2.0)) {  // any command that is not refused, lawful or not
      rig_.command_.articulation_angle = (2.0 * uniform() - 1.0) * 44.9 * kDeg;
      rig_.command_.speed = uniform() * 9.7;
      rig_.command_.acceleration = uniform() * 2.9;
    }
  }

  void misbehave() {
    Faults& faults = rig_.faults;
    if (rig_.now() >= quiet_at_ && disturbed_) calm();
    if (rig_.isJ1939()) misbehaveOnNetwork();
    if (!chance(0.25)) return;
    disturbed_ = true;
    quiet_at_ = rig_.now() + fromSeconds(0.02 + uniform() * uniform() * 1.5);
    switch (below(18)) {
      case 0:
        faults.commands_lost = true;
        break;
      case 1:
        faults.commands_not_finite = true;
        break;
      case 2:
        faults.commands_out_of_range = true;
        break;
      case 3:
        faults.commands_count_back = true;
        break;
      case 4:
        faults.measurement_frozen = true;
        break;
      case 5:
        faults.stop_asked = true;
        break;
      case 6:
        faults.feedback_lost = true;
        break;
      case 7:
        faults.feedback_corrupt = true;
        break;
      case 8:
        faults.counter_stands = true;
        break;
      case 9:
        faults.truck_deaf = true;
        break;
      case 10:
        faults.degraded = true;
        break;
      case 11:
        rig_.cab.steering_wheel = 6.0 * kDeg;
        break;
      case 12:
        rig_.cab.key = static_cast<can::OperatorKey>(below(2));
        break;
      case 13:
        rig_.setFaultBits(static_cast<std::uint16_t>(1u << (2 + below(4))));
        break;
      case 14:
        rig_.setBus(static_cast<can::BusState>(1 + below(4)));
        break;
      case 15:
        rig_.jumpClock(fromSeconds((uniform() - 0.5) * 4.0));
        break;
      case 16:
        faults.process_silent = true;
        break;
      default:
        foreign();
        break;
    }
  }

  // What other nodes of a J1939 network do: ask, claim the pilot's address under a higher NAME, or (for
  // good, so seldom) a lower one, talk like the truck.
  void misbehaveOnNetwork() {
    const can::J1939Parameters& pilot = rig_.pilot();
    const std::uint8_t stranger = 0x55;
    const auto claim = [&](std::uint64_t name) {
      rig_.sendStrange(j1939Frame(6, can::kAddressClaimedPgn, pilot.source_address, name));
    };
    if (chance(0.1)) {
      rig_.sendStrange(j1939Frame(6, can::kRequestPgn, stranger, can::kAddressClaimedPgn, 3));
    }
    if (chance(0.05)) claim(pilot.name + 1);
    if (chance(0.01)) claim(pilot.name - 1);
    if (chance(0.1)) rig_.sendStrange(j1939Frame(3, 0xFF20, stranger, 0x1122334455667788));
  }

  void foreign() {
    static constexpr std::uint32_t kIds[] = {can::kTpCommandId, can::kTpCommandInfoId, can::kTpStatusId};
    can::Frame frame;
    frame.id = kIds[below(3)];
    frame.length = static_cast<std::uint8_t>(below(9));
    for (int i = 0; i < frame.length; ++i) {
      frame.data[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(below(256));
    }
    rig_.sendForeign(frame);
  }

  void calm() {
    disturbed_ = false;
    rig_.faults = {};
    if (rig_.cab.steering_wheel !=
        0.0) {  // who took over turns the key before the pilot may drive again
      rig_.cab.steering_wheel = 0.0;
      rig_.cab.key = can::OperatorKey::kManual;
      disturbed_ = true;
      quiet_at_ = rig_.now() + std::chrono::milliseconds(200);
    } else {
      rig_.cab.key = can::OperatorKey::kAutonomous;
    }
    rig_.setFaultBits(0);
    rig_.setBus(can::BusState::kActive);
  }

  simulation::Random random_;
  Rig rig_;
  bool disturbed_ = false;
  Stamp quiet_at_{};
};

constexpr long long kEpisodeCycles = 3000;  // a minute

// Runs all episodes and writes the log of every `share`-th.
void runTraffic(const Setup& setup, long long cycles, std::uint64_t seed, long long share) {
  can::LogWriter log(std::cout);
  Stamp start = std::chrono::seconds(1000);
  const long long episodes = (cycles + kEpisodeCycles - 1) / kEpisodeCycles;
  for (long long i = 0; i < episodes; ++i) {
    const long long length = std::min(kEpisodeCycles, cycles - i * kEpisodeCycles);
    Episode episode(setup, seed * 1'000'003 + static_cast<std::uint64_t>(i), start,
                    i % share == 0 ? &log : nullptr);
    start = episode.run(length) + std::chrono::seconds(1);
  }
  std::cout.flush();
}

// -------- worst latencies

/// A row of the fault table: how the fault comes, from when its limit counts, and the limit beside which
/// one tick of the bridge is allowed.
struct Row {
  const char* name;
  std::function<void(Rig&)> inject;
  std::function<Stamp(const Rig&)> since;
  double limit;         ///< [ms]
  bool tick;            ///< a tick beside it
  bool standby = true;  ///< it has a meaning in STANDBY
};

std::vector<Row> rows() {
  const auto at_once = [](const Rig& rig) { return rig.now(); };
  const auto feedback = [](const Rig& rig) { return rig.last_good_feedback; };
  const auto command = [](const Rig& rig) { return rig.last_command; };
  const auto foreign = [](Rig& rig) {
    can::Frame frame;
    frame.id = can::kTpCommandId;
    rig.sendForeign(frame);
  };
  return {
      {"A1 commands lost", [](Rig& rig) { rig.faults.commands_lost = true; }, command, 100, true},
      {"A1 measurement frozen", [](Rig& rig) { rig.faults.measurement_frozen = true; },
       [](const Rig& rig) { return rig.last_measurement; }, 300, true},
      {"D1 heartbeats of a process lost", [](Rig& rig) { rig.faults.process_silent = true; },
       [](const Rig& rig) { return rig.last_heartbeat; }, 60, true},
      {"A2 operator's stop", [](Rig& rig) { rig.stop(); }, at_once, 20, false},
      {"A2 operator's release", [](Rig& rig) { rig.release(); }, at_once, 20, false, false},
      {"A2 arbiter's stop (its period of 20 ms included)",
       [](Rig& rig) { rig.faults.stop_asked = true; }, at_once, 20, false},
      {"A4 operator's wheel (a frame of 20 ms included)",
       [](Rig& rig) { rig.cab.steering_wheel = 6.0 * kDeg; }, at_once, 20, true},
      {"A4 key turned (a frame of 20 ms included)",
       [](Rig& rig) { rig.cab.key = can::OperatorKey::kManual; }, at_once, 20, true},
      {"N1 commands not finite", [](Rig& rig) { rig.faults.commands_not_finite = true; }, command, 100,
       true},
      {"N1 commands out of range", [](Rig& rig) { rig.faults.commands_out_of_range = true; }, command,
       100, true},
      {"C3 frames of the truck lost", [](Rig& rig) { rig.faults.feedback_lost = true; }, feedback, 60,
       false},
      {"C4 frames of the truck corrupt", [](Rig& rig) { rig.faults.feedback_corrupt = true; }, feedback,
       60, true},
      {"C4 counter stands", [](Rig& rig) { rig.faults.counter_stands = true; }, feedback, 60, true},
      {"C6 foreign sender", foreign, at_once, 0, true},
      {"truck's fault (a frame of 20 ms included)", [](Rig& rig) { rig.setFaultBits(can::kFaultBrake); },
       at_once, 20, true},
      {"T1 clock forward", [](Rig& rig) { rig.jumpClock(std::chrono::seconds(1)); }, at_once, 20, false},
      {"T1 clock backward", [](Rig& rig) { rig.jumpClock(-std::chrono::seconds(1)); }, at_once, 20,
       false},
  };
}

constexpr Stamp kFineStep = std::chrono::milliseconds(1);

void runFor(Rig& rig, double seconds) {
  for (const Stamp end = rig.now() + fromSeconds(seconds); rig.now() < end;) rig.step(kFineStep);
}

// False when the state was not reached.
bool reach(Rig& rig, SafetyState state, double phase) {
  runFor(rig, 2.5);
  if (state != SafetyState::kStandby) {
    if (!rig.engage()) return false;
    runFor(rig, 2.0);
    rig.faults.degraded = state == SafetyState::kDegraded;
  }
  runFor(rig, 0.5 + phase);
  return rig.state() == state;
}

// True when the truck stays where it is although the operator engages at the limit.
bool staysStanding(Rig& rig, Stamp limit) {
  while (rig.now() < limit) rig.step(kFineStep);
  rig.engage();
  runFor(rig, 0.5);
  return rig.notDrivingSince() && *rig.notDrivingSince() < limit;
}

// From the last good word to the frame that stops [ms], infinite when none came; in STANDBY, where
// nothing is to be stopped, 0 or infinite.
double latency(const Setup& setup, const Row& row, SafetyState state, Stamp tick, double phase) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  Rig rig(setup, fromSeconds(1234.5678), tick, nullptr);
  if (!reach(rig, state, phase)) return kNever;
  const Stamp began = rig.now();
  const Stamp since = row.since(rig);
  row.inject(rig);
  if (state == SafetyState::kStandby) {
    return staysStanding(rig, since + fromSeconds(1e-3 * row.limit) + tick) ? 0.0 : kNever;
  }
  while (!rig.notDrivingSince() && rig.now() < began + std::chrono::seconds(2)) rig.step(kFineStep);
  const std::optional<Stamp> stopped = rig.notDrivingSince();
  return stopped ? 1e3 * toSeconds(*stopped - since) : kNever;
}

// The worst of three seeds with ten phases each [ms].
double worstLatency(const Setup& setup, const Row& row, SafetyState state, int tick,
                    std::uint64_t first_seed) {
  double worst = 0.0;
  for (std::uint64_t seed = first_seed; seed < first_seed + 3; ++seed) {
    simulation::Random random(seed, simulation::Stream::kFaults);
    for (int i = 0; i < 10; ++i) {
      worst = std::max(
          worst, latency(setup, row, state, std::chrono::milliseconds(tick), 0.04 * random.uniform()));
    }
  }
  return worst;
}

// The table in Markdown; false when a limit is broken.
bool printLatencies(const Setup& setup, std::uint64_t first_seed) {
  bool kept = true;
  std::printf("| fault | STANDBY | ACTIVE [ms] | DEGRADED [ms] | limit [ms] |\n|---|---|---|---|---|\n");
  for (const Row& row : rows()) {
    const auto worst = [&](SafetyState state, int tick) {
      const double value = worstLatency(setup, row, state, tick, first_seed);
      kept = kept && value <= row.limit + (row.tick ? tick : 0) + 1e-6;
      return value;
    };
    const char* standby = "-";
    if (row.standby) {
      const double never = worst(SafetyState::kStandby, 5) + worst(SafetyState::kStandby, 20);
      standby = never == 0.0 ? "stands" : "DRIVES";
    }
    std::printf("| %s | %s |", row.name, standby);
    for (const SafetyState state : {SafetyState::kActive, SafetyState::kDegraded}) {
      std::printf(" %.0f / %.0f |", worst(state, 5), worst(state, 20));
    }
    std::printf(" %.0f%s |\n", row.limit, row.tick ? " and a tick" : "");
  }
  return kept;
}

struct Arguments {
  std::string config = "config";
  long long cycles = 1'000'000;
  long long share = 1;
  std::uint64_t seed = 1;
  std::string profile;
  bool latencies = false;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "fault_campaign: bridge and truck in virtual time against random faults; writes the bus to the "
      "standard output (candump -L).\nOptions");
  shown.add_options()("help,h", "this text")("config", options::value(&arguments.config),
                                             "parameter files")(
      "cycles", options::value(&arguments.cycles), "control cycles of 20 ms")(
      "share", options::value(&arguments.share), "writes every N-th minute only")(
      "seed", options::value(&arguments.seed), "of the faults")(
      "profile", options::value(&arguments.profile)->value_name("NAME"),
      "of the CAN bus: plain or j1939, instead of the files'")(
      "latencies", options::bool_switch(&arguments.latencies),
      "instead: the worst latency of each fault beside its limit; exit status 1 when one is broken");
  options::variables_map values;
  options::store(options::parse_command_line(argc, argv, shown), values);
  if (values.count("help") != 0) {
    std::cout << shown;
    return false;
  }
  options::notify(values);
  if (arguments.cycles < 1) throw options::error("--cycles must be 1 or more");
  if (arguments.share < 1) throw options::error("--share must be 1 or more");
  const std::string& profile = arguments.profile;
  if (!profile.empty() && profile != "plain" && profile != "j1939") {
    throw options::error("--profile must be plain or j1939");
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    std::ios::sync_with_stdio(false);
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return 0;
    const Setup setup = loadSetup(arguments.config, arguments.profile);
    if (arguments.latencies) return printLatencies(setup, arguments.seed) ? 0 : 1;
    runTraffic(setup, arguments.cycles, arguments.seed, arguments.share);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "fault_campaign: " << error.what() << "\n";
    return 2;
  }
}
