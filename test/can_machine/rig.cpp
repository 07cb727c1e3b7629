#include "rig.h"

#include <fcntl.h>
#include <linux/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "../allocations.h"
#include "tunnel_pilot/can/layout.h"
#include "tunnel_pilot/simulation/truck_controller.h"

namespace tunnel_pilot::bridge {
namespace {

using std::chrono::milliseconds;
constexpr Stamp kTick = milliseconds(5);
constexpr Stamp kCommandPeriod = milliseconds(20);

config::Node file(const std::string& name) {
  return config::loadFile(std::string(TUNNEL_PILOT_SOURCE_DIR) + "/config/" + name);
}

std::unique_ptr<can::SocketCanBus> join(const std::string& interface, const std::string& helper,
                                        const can::Profile& profile) {
  return std::make_unique<can::SocketCanBus>(interface, can::identifiersOf(profile),
                                             can::openCanSocket(interface, helper));
}

void sleepUntil(Stamp time) {
  std::this_thread::sleep_until(std::chrono::steady_clock::time_point(time));
}

void writeTo(const std::string& path, const std::string& text) {
  std::ofstream out(path);
  out << text << std::flush;
  if (!out) throw std::runtime_error("cannot write '" + text + "' to " + path);
}

}  // namespace

bool allocationsAreCounted() { return allocationsOfOne() == 1; }

Stamp steadyTime() { return Stamp(std::chrono::steady_clock::now().time_since_epoch()); }

can::Profile profileOf(can::Side side, can::ProfileKind kind) {
  can::Profile profile = side == can::Side::kPilot
                             ? loadBridge(file("can_bridge.yaml")).can
                             : simulation::loadTruckController(file("truck_controller.yaml")).can;
  profile.kind = kind;
  return profile;
}

std::vector<can::Identifier> allIdentifiers() {
  return can::identifiersOf(profileOf(can::Side::kPilot, can::ProfileKind::kPlain));
}

std::int64_t ageOf(const can::Frame& frame, Stamp now) {
  const auto info = can::decode<can::CommandInfoFrame>(frame);
  if (!info) return 0;
  const auto now_ms = std::chrono::duration_cast<milliseconds>(now).count();
  const std::int64_t age = static_cast<std::uint16_t>(now_ms - info->measurement_stamp_ms);
  return age < 60000 ? age : 0;  // beyond: rounded from the future
}

// -------- Truck

Truck::Truck(can::ProfileKind kind) : kind_(kind), thread_([this] { run(); }) {}

Truck::~Truck() {
  ends_ = true;
  thread_.join();
}

double Truck::takeWorstAge() { return 1e-3 * static_cast<double>(worst_age_ms_.exchange(0)); }

void Truck::run() {
  const can::Profile profile = profileOf(can::Side::kTruck, kind_);
  const auto bus =
      can::withProfile(profile, join("can1", TUNNEL_PILOT_NODE_FOLDER "/can_link_cycle", profile));
  const auto listener = can::withProfile(profile, join("can1", "", profile));
  simulation::TruckController controller(simulation::loadTruckController(file("truck_controller.yaml")),
                                         *bus);
  const simulation::SensedTruck standing;
  for (Stamp next = steadyTime(); !ends_; next += milliseconds(2)) {
    sleepUntil(next);
    const Stamp now = steadyTime();
    controller.step(standing, now);
    if (bus->state() == can::BusState::kDown || bus->state() == can::BusState::kBusOff) bus->discard();
    while (const auto frame = listener->receive()) judge(*frame, now);
    next = std::max(next, now - milliseconds(2));
  }
}

void Truck::judge(const can::Frame& frame, Stamp now) {
  worst_age_ms_ = std::max<std::int64_t>(worst_age_ms_, ageOf(frame, now));
}

// -------- Injection

Injection::Injection(const std::function<void()>& act, double delay)
    : thread_([this, act, delay] {
        sleepUntil(steadyTime() + fromSeconds(delay));
        begin_ = steadyTime().count();
        act();
        end_ = steadyTime().count();
      }) {}

// -------- Pilot

Pilot::Pilot(const std::string& helper, can::ProfileKind kind)
    : next_tick_(steadyTime()), next_command_(next_tick_) {
  const can::Profile profile = profileOf(can::Side::kPilot, kind);
  auto socket = join("can0", helper, profile);
  bus = socket.get();
  network = can::withProfile(profile, std::move(socket));
  bridge = std::make_unique<CanBridge>(loadBridge(file("can_bridge.yaml")),
                                       vehicle::loadTruck(file("truck.yaml")).geometry, *network);
}

bool Pilot::run(double seconds, const std::function<bool()>& until) {
  const Stamp end = steadyTime() + fromSeconds(seconds);
  while (!until()) {
    if (steadyTime() >= end) return false;
    step();
  }
  return true;
}

void Pilot::step() {
  sleepUntil(next_tick_);
  const Stamp now = steadyTime();
  next_tick_ = std::max(next_tick_ + kTick, now);
  if (now >= next_command_) {
    next_command_ = std::max(next_command_ + kCommandPeriod, now);
    supervision::Command command;
    command.stamp = now;
    command.sequence = sequence_++;
    command.mode = supervision::Mode::kAutonomous;
    command.source = supervision::Source::kPreviewDriver;
    command.acceleration = 0.5;
    event("measurement preview_driver 0", now);
    allocations += allocationsOf([&] { bridge->setCommand(command, now); });
  }
  allocations += allocationsOf([&] { bridge->tick(now); });
  look(now);
}

void Pilot::look(Stamp now) {
  // The bus beneath: under J1939 the address comes on top.
  const bool works = bus->state() != can::BusState::kDown && bus->state() != can::BusState::kBusOff;
  if (works != bus_worked_) event(works ? "bus up" : "bus down", now);
  bus_worked_ = works;
  if (isStop(state()) && !isStop(last_state_))
    stopped_at = now;  // a truck that stands is STOPPED at once
  if (isEngaged(state()) && !engaged_by_us) armed_by_itself = true;
  if (!isEngaged(state())) engaged_by_us = false;
  last_state_ = state();
}

bool Pilot::drive() {
  const Stamp end = steadyTime() + std::chrono::seconds(10);
  while (steadyTime() < end && state() != SafetyState::kActive) {
    sleepUntil(next_tick_);  // by then the frames of the tick before are out
    const Stamp now = steadyTime();
    // Engaged a tick after the reset, which may send a set of its own: that would be on the bus after
    // the engage, and tells of STANDBY.
    if (state() == SafetyState::kStopped) {
      if (bridge->reset(now).accepted) event("reset", now);
    } else if (state() == SafetyState::kStandby && bridge->engage(now).accepted) {
      engaged_by_us = true;
      event("engage", now);
    }
    step();
  }
  return state() == SafetyState::kActive;
}

bool Pilot::busWorks() const {
  return network->state() != can::BusState::kDown && network->state() != can::BusState::kBusOff;
}

// -------- faults

void provoke(const std::string& word, const std::string& interface) {
  writeTo("/sys/kernel/debug/can_fault", interface + " " + word);
}

void setLink(const std::string& interface, bool up) {
  const int number = socket(PF_CAN, SOCK_RAW, 1);
  ifreq request{};
  interface.copy(request.ifr_name, IFNAMSIZ - 1);
  bool good = ioctl(number, SIOCGIFFLAGS, &request) == 0;
  request.ifr_flags = static_cast<short>(up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP);
  good = good && ioctl(number, SIOCSIFFLAGS, &request) == 0;
  close(number);
  if (!good) throw std::runtime_error("cannot set " + interface);
}

void run(const std::string& command) {
  if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
}

void configure(const std::string& interface) {
  run("/sbin/ip link set " + interface + " type can bitrate 500000 restart-ms 0");
}

void cleanLinks() {
  for (const char* interface : {"can0", "can1"}) {
    setLink(interface, false);
    setLink(interface, true);
  }
}

void unplug(const std::string& interface) {
  writeTo("/sys/class/net/" + interface + "/device/remove", "1");
}

void rescan() { writeTo("/sys/bus/pci/rescan", "1"); }

void hangController(const std::string& interface) {
  std::ifstream resources("/sys/class/net/" + interface + "/device/resource");
  std::string line;
  std::getline(resources, line);
  std::getline(resources, line);  // the second holds the controller's registers
  constexpr off_t kInterruptEnable = 4;
  const int ports = open("/dev/port", O_WRONLY);
  const off_t at = std::stol(line.substr(0, line.find(' ')), nullptr, 16) + kInterruptEnable;
  const bool good = pwrite(ports, "\0", 1, at) == 1;
  close(ports);
  if (!good) throw std::runtime_error("cannot write to the controller of " + interface);
}

}  // namespace tunnel_pilot::bridge
