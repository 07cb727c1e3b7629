#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/can/socket_can_bus.h"

namespace tunnel_pilot::bridge {

Stamp steadyTime();
bool allocationsAreCounted();  ///< or Pilot::allocations tells nothing

// -------- what is asked for at a fault

constexpr double kStopLimit = 0.060;      // [s] from the fault
constexpr double kRecoveryLimit = 0.250;  // [s] from the bus's return to a confirmed frame
constexpr double kOutageLimit = 0.500;  // [s] from a fault to a confirmed frame, where the helper helps
constexpr double kAgeLimit = 0.060;     // [s] of what a frame tells, when it comes
constexpr double kLongestAct = 0.001;   // [s] that a fault may come later than it was asked for

/// Who the two sides are on a bus of this kind, by the shipped files.
can::Profile profileOf(can::Side side, can::ProfileKind kind);

std::vector<can::Identifier> allIdentifiers();  ///< of the plain profile

/// Of the measurement that a frame of the bridge tells of [ms]; 0 for other frames.
std::int64_t ageOf(const can::Frame& frame, Stamp now);

/// A truck's controller with a truck that stands, on can1, in a thread of its own, that also judges what
/// it hears of the bridge.
class Truck {
 public:
  explicit Truck(can::ProfileKind kind = can::ProfileKind::kPlain);
  ~Truck();

  /// Oldest measurement that a frame of the bridge told of when it came, since the last call [s].
  double takeWorstAge();

 private:
  void run();
  void judge(const can::Frame& frame, Stamp now);

  can::ProfileKind kind_;
  std::atomic<bool> ends_{false};
  std::atomic<std::int64_t> worst_age_ms_{0};
  std::thread thread_;
};

/// Something done to the bus, in a thread of its own: the bridge is not held up by it.
class Injection {
 public:
  /// `delay`: before it [s].
  explicit Injection(const std::function<void()>& act, double delay = 0.0);
  ~Injection() { thread_.join(); }
  Stamp begin() const { return Stamp(begin_.load()); }
  Stamp end() const { return Stamp(end_.load()); }
  bool begun() const { return begin_ != 0; }
  bool done() const { return end_ != 0; }

 private:
  std::atomic<std::int64_t> begin_{0};
  std::atomic<std::int64_t> end_{0};
  std::thread thread_;
};

/// Arbiter and bridge on can0, ticked every 5 ms of steady time.
class Pilot {
 public:
  explicit Pilot(const std::string& helper = TUNNEL_PILOT_NODE_FOLDER "/can_link_cycle",
                 can::ProfileKind kind = can::ProfileKind::kPlain);

  /// Ticks for a time [s], or until something is so. False when it never was.
  bool run(
      double seconds, const std::function<bool()>& until = [] { return false; });

  /// To ACTIVE, from whatever there is. False when that does not come within 10 s.
  bool drive();

  bool busWorks() const;
  SafetyState state() const { return bridge->status().state; }

  can::SocketCanBus* bus = nullptr;   ///< beneath `network`, or the same
  std::unique_ptr<can::Bus> network;  ///< as the bridge has it
  std::unique_ptr<CanBridge> bridge;
  Stamp stopped_at{};    ///< the tick that stopped
  long allocations = 0;  ///< of bridge and bus, in commands and ticks
  bool engaged_by_us = false;
  bool armed_by_itself = false;

  /// Is told of what the log of events holds.
  std::function<void(const std::string&, Stamp)> event = [](const std::string&, Stamp) {};

 private:
  void step();
  void look(Stamp now);

  Stamp next_tick_, next_command_;
  std::uint32_t sequence_ = 0;
  SafetyState last_state_ = SafetyState::kInit;
  bool bus_worked_ = true;
};

// -------- faults of an interface

void provoke(const std::string& word,
             const std::string& interface = "can0");  ///< by the module can_fault
void setLink(const std::string& interface, bool up);
void cleanLinks();                             ///< nothing is left in the queues of both sides
void configure(const std::string& interface);  ///< bit rate, restart-ms 0; leaves it down
void unplug(const std::string& interface);
void rescan();
void hangController(const std::string& interface);  ///< masks its interrupts
void run(const std::string& command);               ///< of a shell; throws when it fails

}  // namespace tunnel_pilot::bridge
