// The pilot's stages in one thread, in the order of the nodelets': what they compute, from a scan to the
// command that stems from it, in CPU time, without wake-ups and without sockets. All that runs on the
// way counts: before preview_driver's command lidar_driver has proposed and has been judged.
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/TruckCommand.h>

#include <algorithm>
#include <array>
#include <exception>
#include <string>

#include "log.h"
#include "tunnel_pilot/ros/arbiter_ros.h"
#include "tunnel_pilot/ros/centerline_ros.h"
#include "tunnel_pilot/ros/lidar_driver_ros.h"
#include "tunnel_pilot/ros/preview_driver_ros.h"
#include "tunnel_pilot/ros/scan_filter_ros.h"
#include "tunnel_pilot/ros/wall_segmentation_ros.h"

namespace tunnel_pilot::benchmark {
namespace {

class Stages {
 public:
  Stages()
      : nh_(withQueue(ros::NodeHandle(), 0)),
        scan_(nh_.advertise<sensor_msgs::LaserScan>("scan", 1)),
        command_(nh_.subscribe("command", 10, &Stages::onCommand, this)) {}

  // Until the command comes, or long after it should have.
  void answer(const sensor_msgs::LaserScan::ConstPtr& scan) {
    rest();  // what is older is not on this scan's account
    stamp_ = scan->header.stamp;
    answered_ = false;
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(0.02);
    started_ = cpuNow();
    scan_.publish(scan);
    while (!answered_ && ros::SteadyTime::now() < end) callOne();
  }

  void rest() {
    while (callOne()) {
    }
  }

 private:
  ros::NodeHandle withQueue(ros::NodeHandle nh, std::size_t rank) {
    nh.setCallbackQueue(&queues_[rank]);
    return nh;
  }
  ros::NodeHandle nh(std::size_t rank) { return withQueue(ros::NodeHandle(), rank); }
  ros::NodeHandle stage(const std::string& name, std::size_t rank) {
    return withQueue(ros::NodeHandle("~" + name), rank);
  }

  // As Executor does.
  bool callOne() {
    return std::any_of(queues_.begin(), queues_.end(),
                       [](auto& queue) { return queue.callOne() == ros::CallbackQueue::Called; });
  }

  void onCommand(const TruckCommand& command) {
    if (answered_ || command.header.stamp != stamp_) return;
    answered_ = true;
    const std::int64_t taken = cpuNow() - started_;
    if (command.source == TruckCommand::SOURCE_PREVIEW_DRIVER) log_.add("preview_cpu", stamp_, taken);
    if (command.source == TruckCommand::SOURCE_LIDAR_DRIVER) log_.add("lidar_cpu", stamp_, taken);
  }

  Log log_{ros::param::param<std::string>("~log", "")};
  std::array<ros::CallbackQueue, 6> queues_;  // by rank
  ros::NodeHandle nh_;
  ros::Publisher scan_;
  ros::Subscriber command_;
  shell::ScanFilterRos scan_filter_{nh(5), stage("scan_filter", 5)};
  shell::WallSegmentationRos wall_segmentation_{nh(4), stage("wall_segmentation", 4)};
  shell::CenterlineRos centerline_{nh(3), stage("centerline", 3)};
  shell::PreviewDriverRos preview_driver_{nh(2), stage("preview_driver", 2)};
  shell::LidarDriverRos lidar_driver_{nh(1), stage("lidar_driver", 1)};
  shell::ArbiterRos arbiter_{nh(0), stage("arbiter", 0)};
  ros::Time stamp_;
  bool answered_ = true;
  std::int64_t started_ = 0;  // [ns]
};

void run() {
  Stages stages;
  ros::NodeHandle nh;
  const boost::function<void(const sensor_msgs::LaserScan::ConstPtr&)> answer =
      [&stages](const sensor_msgs::LaserScan::ConstPtr& scan) { stages.answer(scan); };
  const ros::Subscriber scans = nh.subscribe<sensor_msgs::LaserScan>(
      "scan_in", 1, answer, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  while (ros::ok()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.005));
    stages.rest();
  }
}

}  // namespace
}  // namespace tunnel_pilot::benchmark

int main(int argc, char** argv) {
  ros::init(argc, argv, "latency_compute");
  const ros::NodeHandle keep_alive;
  try {
    tunnel_pilot::benchmark::run();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
