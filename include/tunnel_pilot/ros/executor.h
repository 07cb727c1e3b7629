#pragma once

#include <ros/callback_queue.h>

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace tunnel_pilot::shell {

/// One thread for the callbacks of several stages, the most urgent first: of the stages that have any,
/// the one of the lowest rank; of one stage, in the order in which they came. A message from stage to
/// stage wakes nobody, where the queues of the nodelet manager wake two threads for each. Since a scan
/// waits until all that stems from the scan before is done, the order of the work does not depend on the
/// scheduler. What a callback throws ends the process.
class Executor {
 public:
  /// This process' executor of that name; it lasts while somebody holds it.
  static std::shared_ptr<Executor> named(const std::string& name);

  explicit Executor(const std::string& name);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// A stage's callback queue, for its node handles. The executor has to outlast it. Neither start() nor
  /// stop() from within a callback.
  class Queue : public ros::CallbackQueue {
   public:
    Queue(Executor& executor, int rank) : executor_(executor), rank_(rank) {}
    ~Queue() override { stop(); }
    Queue(const Queue&) = delete;
    Queue& operator=(const Queue&) = delete;

    /// From now on callbacks are called, those that came before among them.
    void start();
    /// When it returns none runs, nor will any.
    void stop();

    void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) override;

   private:
    friend class Executor;
    Executor& executor_;
    int rank_;
  };

 private:
  void live();
  bool callOne();
  void wake();

  std::mutex running_;          // held during a callback; guards queues_
  std::vector<Queue*> queues_;  // by rank
  std::mutex waiting_;          // guards what follows
  std::condition_variable woken_;
  bool has_work_ = false;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace tunnel_pilot::shell
