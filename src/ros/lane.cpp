#include "tunnel_pilot/ros/lane.h"

#include <pthread.h>

#include <boost/make_shared.hpp>
#include <future>
#include <map>
#include <mutex>
#include <utility>

namespace tunnel_pilot::shell {
namespace {

class Task : public ros::CallbackInterface {
 public:
  explicit Task(const std::function<void()>& work) : task_(work) {}
  std::future<void> end() { return task_.get_future(); }
  CallResult call() override {
    task_();
    return Success;
  }

 private:
  std::packaged_task<void()> task_;
};

}  // namespace

std::shared_ptr<Lane> Lane::named(const std::string& name, ros::WallDuration pace) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<Lane>> lanes;
  const std::lock_guard<std::mutex> lock(mutex);
  std::shared_ptr<Lane> lane = lanes[name].lock();
  if (!lane) {
    lane = std::make_shared<Lane>(name, pace);
    lanes[name] = lane;
  }
  return lane;
}

// ros::AsyncSpinner would not do: it ends with ROS, and whoever is unloaded later would wait for ever.
Lane::Lane(const std::string& name, ros::WallDuration pace) : thread_([this, pace] { live(pace); }) {
  constexpr std::size_t kLongest = 15;  // that the kernel keeps
  pthread_setname_np(thread_.native_handle(), name.substr(0, kLongest).c_str());
}

void Lane::live(ros::WallDuration pace) {
  while (!ends_) {
    if (pace.isZero()) {
      queue_.callAvailable(ros::WallDuration(0.1));
    } else {
      pace.sleep();
      queue_.callAvailable();
    }
  }
}

Lane::~Lane() {
  ends_ = true;
  queue_.disable();
  thread_.join();
}

void Lane::run(const std::function<void()>& work) {
  const auto task = boost::make_shared<Task>(work);
  std::future<void> end = task->end();
  queue_.addCallback(task);
  end.get();
}

}  // namespace tunnel_pilot::shell
