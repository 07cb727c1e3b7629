#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace tunnel_pilot::learning {

/// Holds threads until `count` of them have come, again and again (std::barrier came with C++20).
class Barrier {
 public:
  explicit Barrier(std::size_t count) : count_(count), missing_(count) {}

  void wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    const std::size_t round = round_;
    if (--missing_ == 0) {
      missing_ = count_;
      ++round_;
      complete_.notify_all();
    } else {
      complete_.wait(lock, [&] { return round_ != round; });
    }
  }

 private:
  std::size_t count_;
  std::size_t missing_;
  std::size_t round_ = 0;
  std::mutex mutex_;
  std::condition_variable complete_;
};

}  // namespace tunnel_pilot::learning
