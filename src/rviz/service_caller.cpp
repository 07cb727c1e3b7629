#include "tunnel_pilot/rviz/service_caller.h"

#include <ros/names.h>
#include <ros/service.h>
#include <std_srvs/Trigger.h>

#include <mutex>
#include <thread>

namespace tunnel_pilot::hud {
namespace {

struct Answer {
  bool accepted;
  std::string words;
};

Answer call(const std::string& service) {
  std_srvs::Trigger trigger;
  if (!ros::service::call(service, trigger)) return {false, service + ": the call failed"};
  const bool accepted = trigger.response.success;
  std::string words = service + (accepted ? ": accepted" : ": refused");
  if (!trigger.response.message.empty()) words += ", " + trigger.response.message;
  return {accepted, words};
}

Answer callFirst(const std::vector<std::string>& services) {
  std::string missing;
  for (const auto& service : services) {
    if (ros::service::exists(ros::names::resolve(service), false)) return call(service);
    missing += (missing.empty() ? "" : " or ") + service;
  }
  return {false, "nobody offers the service " + missing};
}

}  // namespace

/// What a thread may still hold of a caller that is gone.
struct ServiceCaller::Link {
  std::mutex mutex;
  ServiceCaller* caller;  // nullptr: gone
};

ServiceCaller::ServiceCaller(QObject* parent) : QObject(parent), link_(std::make_shared<Link>()) {
  link_->caller = this;
}

ServiceCaller::~ServiceCaller() {
  const std::lock_guard<std::mutex> lock(link_->mutex);
  link_->caller = nullptr;
}

void ServiceCaller::call(const std::vector<std::string>& services) {
  std::thread([link = link_, services] {
    const Answer answer = callFirst(services);
    const std::lock_guard<std::mutex> lock(link->mutex);
    ServiceCaller* caller = link->caller;
    if (caller == nullptr) return;
    const auto tell = [caller, answer] {
      Q_EMIT caller->answered(answer.accepted, QString::fromStdString(answer.words));
    };
    QMetaObject::invokeMethod(caller, tell, Qt::QueuedConnection);
  }).detach();
}

}  // namespace tunnel_pilot::hud
