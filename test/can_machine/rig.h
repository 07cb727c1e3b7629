#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/can/socket_can_bus.h"

namespace tunnel_pilot::bridge {

Stamp steadyTime();

std::vector<can::Identifier> allIdentifiers();

/// A truck's controller with a truck that stands, on can1, in a thread of its own, that also judges what
/// it hears of the bridge.
class Truck {
 public:
  Truck();
  ~Truck();

  /// Oldest measurement that a frame of the bridge told of when it came, since the last call [s].
  double takeWorstAge();

 private:
  void run();
  void judge(const can::Frame& frame, Stamp now);

  std::atomic<bool> ends_{false};
  std::atomic<std::int64_t> worst_age_ms_{0};
  std::thread thread_;
};

/// Something done to the bus, in a thread of its own: the bridge is not held up by it.
class Injection {
 public:
  explicit Injection(const std::function<void()>& act);
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
  explicit Pilot(const std::string& helper = TUNNEL_PILOT_NODE_FOLDER "/can_link_cycle");

  /// Ticks for a time [s], or until something is so. False when it never was.
  bool run(
      double seconds, const std::function<bool()>& until = [] { return false; });

  /// To ACTIVE, from whatever there is. False when that does not come within 10 s.
  bool drive();

  bool busWorks() const;
  SafetyState state() const { return bridge->status().state; }

  std::unique_ptr<can::SocketCanBus> bus;
  std::unique_ptr<CanBridge> bridge;
  Stamp stopped_at{};  ///< the tick that stopped
  bool engaged_by_us = false;
  bool armed_by_itself = false;

 private:
  void step();

  Stamp next_tick_, next_command_;
  std::uint32_t sequence_ = 0;
  SafetyState last_state_ = SafetyState::kInit;
};

// -------- faults of an interface

void provoke(const std::string& word);  ///< by the module can_fault, on can0
void setLink(const std::string& interface, bool up);
void configure(const std::string& interface);  ///< bit rate, restart-ms 0; leaves it down
void unplug(const std::string& interface);
void rescan();
void hangController(const std::string& interface);  ///< masks its interrupts

}  // namespace tunnel_pilot::bridge
