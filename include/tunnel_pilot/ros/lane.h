#pragma once

#include <ros/callback_queue.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace tunnel_pilot::shell {

/// A callback queue with a thread of its own, for nodelets. Those that wait for one another share one: a
/// message between them wakes nobody, and one to another lane wakes one thread, where the queues of the
/// nodelet manager wake two for each. Callbacks of a lane run one at a time, in the order in which they
/// came. What one throws ends the process.
class Lane {
 public:
  /// This process' lane of that name; it lasts while somebody holds it. With a pace it is not woken, but
  /// looks every so often for what has come.
  static std::shared_ptr<Lane> named(const std::string& name, ros::WallDuration pace = {});

  explicit Lane(const std::string& name, ros::WallDuration pace = {});
  ~Lane();
  Lane(const Lane&) = delete;
  Lane& operator=(const Lane&) = delete;

  /// For the node handles of who works here.
  ros::CallbackQueue& queue() { return queue_; }

  /// Does `work` in the lane's thread, between two callbacks, and waits for its end. Throws what it
  /// throws.
  void run(const std::function<void()>& work);

 private:
  void live(ros::WallDuration pace);

  ros::CallbackQueue queue_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace tunnel_pilot::shell
