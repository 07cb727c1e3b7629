// A nodelet beside the pilot's, in their manager. It notes when a scan has arrived there, and when what
// stems from it is published there: the receipt times that roscpp gives messages, a scan in the thread
// that reads it off the socket, all else in the publisher's own. It reads them off twice a second, so no
// thread is woken for it while the pilot works.
#include <nodelet/nodelet.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TunnelState.h>
#include <tunnel_pilot/Walls.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

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
    listen<sensor_msgs::LaserScan>(nh, "scan", "pilot_arrived");
    listen<sensor_msgs::PointCloud2>(nh, "points", "points");
    listen<Walls>(nh, "walls", "walls");
    listen<TunnelState>(nh, "tunnel_state", "tunnel_state");
    listen<Proposal>(nh, "preview_driver/proposal", "preview_proposal");
    listen<Proposal>(nh, "lidar_driver/proposal", "lidar_proposal");
    listen<TruckCommand>(nh, "command", "pilot_published");
  }

  template <class Message>
  void listen(ros::NodeHandle& nh, const std::string& topic, const std::string& event) {
    const boost::function<void(const ros::MessageEvent<const Message>&)> note =
        [this, event](const ros::MessageEvent<const Message>& message) {
          log_->add(event, message.getConstMessage()->header.stamp, message.getReceiptTime());
        };
    subscribers_.push_back(nh.subscribe<Message>(topic, kQueue, note, ros::VoidConstPtr(),
                                                 ros::TransportHints().tcpNoDelay()));
  }

  void read() {
    queue_.callAvailable();
    log_->flush();
  }

  std::unique_ptr<Log> log_;
  ros::CallbackQueue queue_;
  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer timer_;
};

}  // namespace tunnel_pilot::benchmark

PLUGINLIB_EXPORT_CLASS(tunnel_pilot::benchmark::LatencyProbe, nodelet::Nodelet)
