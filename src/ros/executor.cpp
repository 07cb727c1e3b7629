#include "tunnel_pilot/ros/executor.h"

#include <pthread.h>

#include <algorithm>
#include <map>

namespace tunnel_pilot::shell {

std::shared_ptr<Executor> Executor::named(const std::string& name) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<Executor>> executors;
  const std::lock_guard<std::mutex> lock(mutex);
  std::shared_ptr<Executor> executor = executors[name].lock();
  if (!executor) {
    executor = std::make_shared<Executor>(name);
    executors[name] = executor;
  }
  return executor;
}

Executor::Executor(const std::string& name) : thread_([this] { live(); }) {
  constexpr std::size_t kLongest = 15;  // that the kernel keeps
  pthread_setname_np(thread_.native_handle(), name.substr(0, kLongest).c_str());
}

Executor::~Executor() {
  {
    const std::lock_guard<std::mutex> lock(waiting_);
    ends_ = true;
  }
  woken_.notify_one();
  thread_.join();
}

void Executor::live() {
  for (;;) {
    {
      std::unique_lock<std::mutex> lock(waiting_);
      woken_.wait(lock, [this] { return has_work_ || ends_; });
      if (ends_) return;
      has_work_ = false;
    }
    while (callOne()) {
    }
  }
}

// False when no stage has anything to do.
bool Executor::callOne() {
  const std::lock_guard<std::mutex> lock(running_);
  for (Queue* const queue : queues_) {
    if (queue->callOne() == ros::CallbackQueue::Called) return true;
  }
  return false;
}

void Executor::wake() {
  {
    const std::lock_guard<std::mutex> lock(waiting_);
    has_work_ = true;
  }
  if (std::this_thread::get_id() != thread_.get_id()) woken_.notify_one();
}

void Executor::Queue::start() {
  {
    const std::lock_guard<std::mutex> lock(executor_.running_);
    auto& queues = executor_.queues_;
    const auto later = [this](const Queue* other) { return other->rank_ > rank_; };
    queues.insert(std::find_if(queues.begin(), queues.end(), later), this);
  }
  executor_.wake();
}

void Executor::Queue::stop() {
  const std::lock_guard<std::mutex> lock(executor_.running_);
  auto& queues = executor_.queues_;
  queues.erase(std::remove(queues.begin(), queues.end(), this), queues.end());
}

void Executor::Queue::addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) {
  ros::CallbackQueue::addCallback(callback, removal_id);
  executor_.wake();
}

}  // namespace tunnel_pilot::shell
