#pragma once

#include <ros/time.h>

#include <cstdint>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <string>

namespace tunnel_pilot::benchmark {

/// CPU time of this thread [ns].
inline std::int64_t cpuNow() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * std::int64_t{1000000000} + now.tv_nsec;
}

/// What happened to which scan, a line an event: its name, the scan's stamp and a value, in nanoseconds
/// (a time of ROS' clock, or a duration). benchmark/latency/report.py reads it.
class Log {
 public:
  explicit Log(const std::string& file) : file_(file) {
    if (!file_) throw std::runtime_error(file + " cannot be written");
  }

  void add(const std::string& event, ros::Time scan, std::int64_t value) {
    file_ << event << ' ' << scan.toNSec() << ' ' << value << '\n';
  }
  void add(const std::string& event, ros::Time scan, ros::Time at) {
    add(event, scan, static_cast<std::int64_t>(at.toNSec()));
  }
  void flush() { file_.flush(); }

 private:
  std::ofstream file_;
};

}  // namespace tunnel_pilot::benchmark
