// A nodelet beside the pilot's, in their manager. It notes when a scan has arrived there and when a
// command is published there: the receipt times that roscpp gives messages, a scan in the thread that
// reads it off the socket, a command in the arbiter's own. It reads them off twice a second, so no
// thread is woken for it while the pilot works.
#include <nodelet/nodelet.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/TruckCommand.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "log.h"

namespace tunnel_pilot::benchmark {

class LatencyProbe : public nodelet::Nodelet {
 public:
  ~LatencyProbe() override {
    timer_.stop();
    queue_.disable();
  }

 private:
  static constexpr int kQueue = 1000;  // of half a second's messages

  void onInit() override {
    log_ = std::make_unique<Log>(getPrivateNodeHandle().param<std::string>("log", ""));
    ros::NodeHandle nh = getNodeHandle();
    timer_ = nh.createWallTimer(ros::WallDuration(0.5), [this](const ros::WallTimerEvent&) { read(); });
    nh.setCallbackQueue(&queue_);
    const auto hints = ros::TransportHints().tcpNoDelay();
    scan_ = nh.subscribe("scan", kQueue, &LatencyProbe::onScan, this, hints);
    command_ = nh.subscribe("command", kQueue, &LatencyProbe::onCommand, this, hints);
  }

  void onScan(const ros::MessageEvent<const sensor_msgs::LaserScan>& event) {
    log_->add("pilot_arrived", event.getConstMessage()->header.stamp, event.getReceiptTime());
  }
  void onCommand(const ros::MessageEvent<const TruckCommand>& event) {
    log_->add("pilot_published", event.getConstMessage()->header.stamp, event.getReceiptTime());
  }
  void read() {
    queue_.callAvailable();
    log_->flush();
  }

  std::unique_ptr<Log> log_;
  ros::CallbackQueue queue_;
  ros::Subscriber scan_, command_;
  ros::WallTimer timer_;
};

}  // namespace tunnel_pilot::benchmark

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::benchmark::LatencyProbe, nodelet::Nodelet)
