#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tunnel_pilot/can/frame.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::bridge {

/// Records what is on the bus with the kernel's stamps, from can2, a controller that nothing is done to,
/// and what happens off the bus: for the monitor of test/bus_monitor. Remote frames are left out.
/// Begins and ends with a silent bus: it counts what the kernel counts.
class Recorder {
 public:
  Recorder();
  ~Recorder();

  /// Something that docs/can.md calls an event.
  void event(const std::string& words, Stamp at);

  /// What was on the bus since a time, until now.
  std::vector<std::pair<Stamp, can::Frame>> since(Stamp begin) const;

  /// Ends. What is missing by the counts of the kernel, in one word, or "nothing".
  std::string end();

  /// Ends, and hands all over to scripts/can_machine, which has it judged if nothing is missing in it.
  /// `profile`: of the bus.
  void handOver(const std::string& name, const std::string& profile);

 private:
  void run();

  int socket_ = -1;
  long heard_before_, lost_before_, sent_before_;
  long heard_ = 0;            ///< frames, those left out, too
  std::uint32_t unread_ = 0;  ///< by the kernel's count of what the socket had no room for
  Stamp offset_{};            ///< of the clock that stamps frames, ahead of the steady one
  std::atomic<bool> ends_{false};
  mutable std::mutex mutex_;
  std::vector<std::pair<Stamp, can::Frame>> frames_;
  std::vector<std::pair<Stamp, std::string>> events_;
  std::thread thread_;
};

}  // namespace tunnel_pilot::bridge
