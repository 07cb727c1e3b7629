// soak: the whole pilot and the simulator's truck in one process for many simulated hours. Stops and
// faults come at random; each stop is held against its limit, and the memory against its growth.
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tunnel_pilot/bridge/heartbeat_watch.h"
#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/world/world.h"

namespace {

namespace options = boost::program_options;
using namespace tunnel_pilot;
using bridge::SafetyState;

constexpr double kDeg = 3.14159265358979323846 / 180.0;
constexpr Stamp kBeat = std::chrono::milliseconds(20);
constexpr const char* kProcess = "/arbiter";
constexpr double kMaxGrowth = 1.0;        // of the resident memory [MiB/h]
constexpr double kWarmUp = 4.0;           // [h] that do not count for it
constexpr double kSlowestBrake = 1.5;     // any stop brakes with at least this [m/s^2] ...
constexpr double kBrakeDelay = 1.0;       // ... after at most this [s]
constexpr double kLongestRestart = 20.0;  // then the operator drives by hand [s]
constexpr double kWayByHand = 25.0;       // [m]
constexpr double kSpeedByHand = 1.5;      // [m/s]
constexpr double kSightByHand = 7.0;      // [m]
constexpr double kLongestByHand = 60.0;   // [s]

/// What lies between the bridge and the truck.
class Wire {
 public:
  can::Bus& pilotBus() { return *pilot_bus_; }
  can::Bus& truckBus() { return *truck_bus_; }

  void carry(Stamp now) {
    while (const std::optional<can::Frame> frame = to_pilot_->receive()) {
      look(*frame, now);
      to_truck_->send(*frame);
    }
    while (std::optional<can::Frame> frame = to_truck_->receive()) {
      if (truck_lost || !passes_) continue;
      if (truck_corrupt) frame->data[4] ^= 0x10;
      if (!truck_corrupt) last_good_feedback = now;
      to_pilot_->send(*frame);
    }
  }

  void setState(can::BusState state) {
    passes_ = state != can::BusState::kBusOff && state != can::BusState::kDown;
    pilot_side_.setState(state);
  }

  void sendForeign() {
    can::Frame frame;
    frame.id = can::kTpCommandId;
    frame.length = 8;
    to_pilot_->send(frame);
  }

  /// Since when every frame of the pilot's has told a stop or no steering.
  std::optional<Stamp> notDrivingSince() const { return not_driving_since_; }

  bool truck_lost = false;
  bool truck_corrupt = false;
  Stamp last_good_feedback{};
  Stamp last_driving{};  ///< frame of the pilot's that drives

 private:
  void look(const can::Frame& frame, Stamp now) {
    const auto command = can::decode<can::TruckCommandFrame>(frame);
    if (!command) return;
    if (command->steering_enable && !command->stop) {
      last_driving = now;
      not_driving_since_.reset();
    } else if (!not_driving_since_) {
      not_driving_since_ = now;
    }
  }

  can::MemoryBusHub pilot_side_, truck_side_;
  std::unique_ptr<can::Bus> pilot_bus_ = pilot_side_.connect();
  std::unique_ptr<can::Bus> truck_bus_ = truck_side_.connect();
  std::unique_ptr<can::Bus> to_pilot_ = pilot_side_.connect();
  std::unique_ptr<can::Bus> to_truck_ = truck_side_.connect();
  std::optional<Stamp> not_driving_since_;
  bool passes_ = true;
};

/// Resident memory, and what of it is handed out [MiB].
struct Memory {
  double hour;  ///< simulated [h]
  double resident;
  double heap;
};

/// What is handed out of the heap [bytes].
double heapInUse() {
#if __GLIBC_PREREQ(2, 33)
  const struct mallinfo2 heap = mallinfo2();
#else  // its numbers turn over at 2 GiB, of which the pilot needs a hundredth
  const struct mallinfo heap = mallinfo();
#endif
  return static_cast<double>(heap.uordblks) + static_cast<double>(heap.hblkhd);
}

Memory readMemory(double hour) {
  std::ifstream file("/proc/self/statm");
  double total = 0.0, resident = 0.0;  // [pages]
  if (!(file >> total >> resident)) throw std::runtime_error("cannot read /proc/self/statm");
  constexpr double kMiB = 1024.0 * 1024.0;
  return {hour, resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / kMiB, heapInUse() / kMiB};
}

/// By least squares, of what was measured after the warm-up [MiB/h]; none of less than four hours more.
std::optional<double> slopeOf(const std::vector<Memory>& samples, double Memory::*value) {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  for (const Memory& sample : samples) {
    if (sample.hour < kWarmUp) continue;
    n += 1.0, x += sample.hour, y += sample.*value;
    xx += sample.hour * sample.hour, xy += sample.hour * (sample.*value);
  }
  if (n < 5.0) return std::nullopt;
  return (n * xy - x * y) / (n * xx - x * x);
}

class Soak;

/// Who stops the truck: the pilot by its frames, or the truck itself, for lack of them.
enum class By { kPilot, kTruck };

/// A way to be stopped, and how long after `since` that must be.
struct Kind {
  const char* name;
  double limit;  ///< [ms]
  std::function<void(Soak&)> begin;
  std::function<Stamp(const Soak&)> since;
  By by = By::kPilot;
  bool takes_over = false;  ///< the operator does, and brakes
  int count = 0;
  int missed = 0;
  double worst = 0.0;        ///< [ms]
  double worst_brake = 0.0;  ///< from there to standstill, of what may be used for it [1]
};

class Soak {
 public:
  Soak(const simulation::Setup& setup, const simulation::Scenario& scenario,
       const simulation::DriveExperiment& drive, std::uint64_t seed)
      : random_(seed, simulation::Stream::kFaults),
        truck_(setup.truck.geometry),
        tick_(fromSeconds(1.0 / simulation::Pilot::kTickRate)),
        simulator_(setup.simulator, setup.truck_controller, setup.truck,
                   makePlant(scenario.plant, setup.truck, seed), scenario.plant.load,
                   world::loadWorld(drive.world_file, {seed, false}), seed, wire_.truckBus()),
        pilot_(setup.pilot, setup.truck, wire_.pilotBus()),
        station_(drive.station),
        heartbeats_({kProcess}, setup.pilot.bridge.heartbeat_timeout),
        kinds_(kinds()) {
    if (!simulator_.world().design_line.closed()) {
      throw std::runtime_error(drive.world_file + " is no closed way");
    }
  }

  /// `progress` is called with every hour driven.
  void run(double hours, const std::function<void(const Memory&)>& progress) {
    end_ = fromSeconds(3600.0 * hours);
    progress_ = progress;
    sampleMemory();
    simulator_.place(simulator_.poseOnLine(station_, 0.0, 0.0));
    restart();
    while (!over()) {
      if (driveFor(random_.uniform(2.0, 40.0))) {
        stopBy(kinds_[static_cast<std::size_t>(random_.uniform() * static_cast<double>(kinds_.size()))]);
      } else if (!over()) {
        ++unasked_[whyUnasked()];
      }
      restart();
    }
  }

  const std::vector<Kind>& stops() const { return kinds_; }
  const std::vector<Memory>& memory() const { return memory_; }
  const std::map<std::string, int>& unasked() const { return unasked_; }
  int byHand() const { return by_hand_; }
  int startedUnasked() const { return started_unasked_; }
  std::uint32_t contacts() const { return simulator_.truth().contacts; }
  double kilometres() const { return 1e-3 * way_; }
  double hours() const { return toSeconds(simulator_.now()) / 3600.0; }

 private:
  Stamp now() const { return simulator_.now(); }
  bool over() const { return now() >= end_; }
  SafetyState state() const { return pilot_.bridge().status().state; }
  bool obeys() const {
    return simulator_.controller().state() == simulation::TruckController::State::kObeying;
  }
  bool stands() const { return std::abs(simulator_.state().speed) < 0.05; }
  bool driving() const { return obeys() && isEngaged(state()) && !wire_.notDrivingSince(); }

  std::vector<Kind> kinds();

  // -------- time

  void step() {
    const simulation::Simulator::Events& events = simulator_.step();
    way_ += std::abs(simulator_.state().speed) * simulator_.parameters().step;
    wire_.carry(now());
    if (!pilot_hangs_) stepPilot(events.scan);
    if (now() >= next_hour_) sampleMemory();
    if (unasked_since_ && (engagedByItself() || wire_.last_driving > *unasked_since_)) {
      ++started_unasked_;
      unasked_since_.reset();  // counted once
    }
  }

  bool engagedByItself() const { return isEngaged(state()) && !pilot_hangs_; }

  void stepPilot(const geometry::Scan* scan) {
    if (now() >= next_beat_ && !process_silent_) {
      heartbeats_.heard(kProcess, now());
      last_beat_ = now();
      next_beat_ = now() + kBeat;
    }
    pilot_.bridge().setSilentProcess(heartbeats_.silent(now()));
    if (scan != nullptr) {
      last_scan_ = scan->stamp;
      pilot_.takeScan(*scan, now());
    }
    if (now() >= next_tick_) {
      pilot_.tick(now());
      next_tick_ = now() + tick_;
    }
    wire_.carry(now());
  }

  // False when `seconds` are over first.
  bool runUntil(double seconds, const std::function<bool()>& done) {
    for (const Stamp end = now() + fromSeconds(seconds); now() < end && !over();) {
      if (done()) return true;
      step();
    }
    return done();
  }

  void sampleMemory() {
    memory_.push_back(readMemory(hours()));
    next_hour_ += std::chrono::hours(1);
    progress_(memory_.back());
  }

  // -------- drive, stop, drive again

  // False when it stopped before, or the soak is over.
  bool driveFor(double seconds) {
    const bool ended = runUntil(seconds, [&] { return !driving() || touched(); });
    return !ended && !over();
  }

  bool touched() const { return simulator_.truth().contacts > contacts_before_; }

  std::string whyUnasked() const {
    if (touched()) return "contact";
    if (isEngaged(state())) return "the truck does not obey";
    return supervision::toString(pilot_.bridge().status().reason);
  }

  void stopBy(Kind& kind) {
    fault_at_ = now();
    kind.begin(*this);
    wire_.carry(now());
    const bool found = runUntil(
        1.0, [&] { return kind.by == By::kTruck ? !obeys() : wire_.notDrivingSince().has_value(); });
    const double latency = 1e3 * toSeconds(now() - kind.since(*this));
    unasked_since_ = now();
    takeOver(kind);
    const double allowed = std::abs(simulator_.state().speed) / kSlowestBrake + kBrakeDelay;
    const Stamp brakes = now();
    const bool stood = runUntil(allowed, [&] { return stands(); });
    if (over()) return;  // the end is no stop
    ++kind.count;
    kind.worst = std::max(kind.worst, found ? latency : std::numeric_limits<double>::infinity());
    kind.worst_brake = std::max(kind.worst_brake, toSeconds(now() - brakes) / allowed);
    if (!found || latency > kind.limit + 1e-6 || !stood) ++kind.missed;
    runUntil(random_.uniform(0.5, 2.0), [] { return false; });
  }

  // Who takes over brakes.
  void takeOver(const Kind& kind) {
    if (!kind.takes_over) return;
    cab_.brake = 0.8;
    simulator_.controller().setOperator(cab_);
  }

  // All is well again, and the operator wants to drive. Where the pilot does not, the operator drives on
  // by hand, to another place.
  void restart() {
    unasked_since_ = now();
    calm();
    while (!over() && !runUntil(kLongestRestart, [&] { return tryToDrive(); })) driveByHand();
    contacts_before_ = contacts();
  }

  void driveByHand() {
    ++by_hand_;
    unasked_since_ = now();
    turnKey(can::OperatorKey::kManual);
    const double end = way_ + kWayByHand;
    runUntil(kLongestByHand, [&] {
      lead(kSpeedByHand);
      return way_ > end;
    });
    runUntil(kLongestByHand, [&] {
      lead(0.0);
      return stands();
    });
    simulator_.lead({});
    turnKey(can::OperatorKey::kAutonomous);
  }

  // Towards a point of the design line before the truck.
  void lead(double speed) {
    const geometry::Path& line = simulator_.world().design_line;
    const geometry::Pose& pose = simulator_.state().pose;
    const geometry::PathPoint goal = line.at(line.project(pose.position()).s + kSightByHand);
    const geometry::Pose place = pose.relative({goal.x, goal.y, goal.heading});
    const double curvature = 2.0 * place.y / (place.x * place.x + place.y * place.y);
    simulator_.lead(vehicle::PlantInput{vehicle::steadyArticulation(truck_, curvature),
                                        std::clamp(speed - simulator_.state().speed, -1.5, 0.5)});
  }

  void turnKey(can::OperatorKey key) {
    cab_.key = key;
    simulator_.controller().setOperator(cab_);
  }

  void calm() {
    wire_.truck_lost = wire_.truck_corrupt = false;
    wire_.setState(can::BusState::kActive);
    pilot_hangs_ = process_silent_ = false;
    simulator_.setLidarAlive(true);
    simulator_.controller().setFaults(0);
    cab_ = {};
    turnKey(can::OperatorKey::kManual);
    runUntil(0.2, [] { return false; });
    turnKey(can::OperatorKey::kAutonomous);
  }

  // The operator's edges, ten times a second; true once the truck drives.
  bool tryToDrive() {
    if (now() >= next_try_) {
      next_try_ = now() + std::chrono::milliseconds(100);
      if (state() == SafetyState::kStopped) pilot_.bridge().reset(now());
      if (state() == SafetyState::kStandby && pilot_.bridge().engage(now()).accepted) {
        unasked_since_.reset();
      }
      wire_.carry(now());
    }
    return driving();
  }

  simulation::Random random_;
  vehicle::TruckGeometry truck_;
  Stamp tick_;
  Wire wire_;
  simulation::Simulator simulator_;
  simulation::Pilot pilot_;
  double station_;  ///< where it begins [m]
  bridge::HeartbeatWatch heartbeats_;
  std::vector<Kind> kinds_;
  simulation::OperatorInputs cab_;
  std::function<void(const Memory&)> progress_;
  std::vector<Memory> memory_;
  std::map<std::string, int> unasked_;  ///< stops of the pilot's own, by their reason
  Stamp end_{}, next_tick_{}, next_beat_{}, next_hour_{}, next_try_{}, last_beat_{}, last_scan_{},
      fault_at_{};
  double way_ = 0.0;  ///< [m]
  int by_hand_ = 0;
  int started_unasked_ = 0;
  std::uint32_t contacts_before_ = 0;
  bool pilot_hangs_ = false;
  bool process_silent_ = false;
  std::optional<Stamp> unasked_since_;  ///< nobody wants to drive
};

std::vector<Kind> Soak::kinds() {
  const double tick = 1e3 * toSeconds(tick_);               // [ms]
  const double steps = 2e3 * simulator_.parameters().step;  // until it compares, until that is seen
  const auto at_once = [](const Soak& soak) { return soak.fault_at_; };
  const auto feedback = [](const Soak& soak) { return soak.wire_.last_good_feedback; };
  const auto turn = [](Soak& soak, can::OperatorKey key, double wheel) {
    soak.cab_.key = key;
    soak.cab_.steering_wheel = wheel;
    soak.simulator_.controller().setOperator(soak.cab_);
  };
  return {
      {"operator's stop", 20.0, [](Soak& s) { s.pilot_.bridge().stop(s.now()); }, at_once},
      {"operator's release", 20.0, [](Soak& s) { s.pilot_.bridge().release(s.now()); }, at_once},
      {"operator's wheel", 20.0 + tick,
       [turn](Soak& s) { turn(s, can::OperatorKey::kAutonomous, 6.0 * kDeg); }, at_once, By::kPilot,
       true},
      {"key turned", 20.0 + tick, [turn](Soak& s) { turn(s, can::OperatorKey::kManual, 0.0); }, at_once,
       By::kPilot, true},
      {"truck's fault", 20.0 + tick,
       [](Soak& s) { s.simulator_.controller().setFaults(can::kFaultBrake); }, at_once},
      {"frames of the truck lost", 60.0 + tick, [](Soak& s) { s.wire_.truck_lost = true; }, feedback},
      {"frames of the truck corrupt", 60.0 + tick, [](Soak& s) { s.wire_.truck_corrupt = true; },
       feedback},
      {"foreign sender", tick, [](Soak& s) { s.wire_.sendForeign(); }, at_once},
      {"bus down", 100.0 + steps, [](Soak& s) { s.wire_.setState(can::BusState::kDown); }, at_once,
       By::kTruck},
      {"bus-off", 100.0 + steps, [](Soak& s) { s.wire_.setState(can::BusState::kBusOff); }, at_once,
       By::kTruck},
      {"pilot's process stands still", 100.0 + steps, [](Soak& s) { s.pilot_hangs_ = true; }, at_once,
       By::kTruck},
      {"heartbeats of a process lost", 60.0 + tick, [](Soak& s) { s.process_silent_ = true; },
       [](const Soak& s) { return s.last_beat_; }},
      {"scans lost (the arbiter's period of 20 ms included)", 320.0,
       [](Soak& s) { s.simulator_.setLidarAlive(false); }, [](const Soak& s) { return s.last_scan_; }},
  };
}

// -------- the report

// True when every limit was kept.
bool report(const Soak& soak) {
  int stops = 0, missed = 0;
  std::printf(
      "| stop | times | worst [ms] | limit [ms] | standstill, of the time allowed | missed |\n"
      "|---|---|---|---|---|---|\n");
  for (const Kind& kind : soak.stops()) {
    std::printf("| %s | %d | %.0f | %.0f | %.0f %% | %d |\n", kind.name, kind.count, kind.worst,
                kind.limit, 100.0 * kind.worst_brake, kind.missed);
    stops += kind.count;
    missed += kind.missed;
  }
  std::printf("\n| stop of the pilot's own | times |\n|---|---|\n");
  for (const auto& [reason, count] : soak.unasked()) std::printf("| %s | %d |\n", reason.c_str(), count);
  std::printf("\n| after [h] | resident [MiB] | heap [MiB] |\n|---|---|---|\n");
  for (const Memory& sample : soak.memory()) {
    std::printf("| %.0f | %.2f | %.3f |\n", sample.hour, sample.resident, sample.heap);
  }
  const std::optional<double> resident = slopeOf(soak.memory(), &Memory::resident);
  const std::optional<double> heap = slopeOf(soak.memory(), &Memory::heap);
  const bool flat = !resident || *resident < kMaxGrowth;
  const bool kept = flat && missed == 0 && soak.startedUnasked() == 0 && soak.contacts() == 0;
  std::printf("\n%s: %.2f simulated hours, %.1f km, %d stops, %d missed; ", kept ? "kept" : "MISSED",
              soak.hours(), soak.kilometres(), stops, missed);
  std::printf("%d starts unasked, %u contacts, driven on by hand %d times; ", soak.startedUnasked(),
              soak.contacts(), soak.byHand());
  if (resident) {
    std::printf("memory grows by %.3f MiB/h (heap: %.3f), limit %.0f\n", *resident, *heap, kMaxGrowth);
  } else {
    std::printf("memory not judged, that takes 8 hours\n");
  }
  return kept;
}

struct Arguments {
  std::string scenario = "scenarios/default_drift.yaml";
  std::string config;
  double hours = 72.0;
  std::uint64_t seed = 1000;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "soak: the whole pilot and the simulated truck in one process for many simulated hours, with "
      "stops "
      "and faults at random.\nOptions");
  shown.add_options()("help,h", "this text")("hours", options::value(&arguments.hours), "simulated")(
      "seed", options::value(&arguments.seed), "of the faults, the sensors and the road")(
      "scenario", options::value(&arguments.scenario)->value_name("FILE"),
      "a drive on a closed way, round and round")("config",
                                                  options::value(&arguments.config)->value_name("DIR"),
                                                  "parameter files instead of the scenario's");
  options::variables_map values;
  options::store(options::parse_command_line(argc, argv, shown), values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 every limit was kept, 1 one was not, 2 bad input.\n";
    return false;
  }
  options::notify(values);
  if (!(arguments.hours > 0.0 && arguments.hours <= 10000.0)) {
    throw options::error("--hours must be more than 0 and at most 10000");
  }
  return true;
}

bool soak(const Arguments& arguments) {
  simulation::Scenario scenario = simulation::loadScenario(arguments.scenario);
  if (!arguments.config.empty()) scenario.config_folder = arguments.config;
  const auto* drive = std::get_if<simulation::DriveExperiment>(&scenario.experiment);
  if (drive == nullptr) throw std::runtime_error(arguments.scenario + " is no drive");
  simulation::Setup setup = simulation::loadSetup(scenario);
  simulation::chooseDriver(scenario, simulation::DriverChoice::kAll, "", setup);
  setup.pilot.preview_driver.speed = setup.pilot.lidar_driver.speed = drive->top_speed;
  Soak soak(setup, scenario, *drive, arguments.seed);
  soak.run(arguments.hours, [](const Memory& sample) {
    std::fprintf(stderr, "%.0f h: %.2f MiB\n", sample.hour, sample.resident);
  });
  return report(soak);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Arguments arguments;
    if (!parse(argc, argv, arguments)) return 0;
    return soak(arguments) ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << "soak: " << error.what() << "\n";
    return 2;
  }
}
