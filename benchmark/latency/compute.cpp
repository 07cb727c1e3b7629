// The pilot's stages with one thread for all of them: what they compute, from a scan to the command that
// stems from it, in CPU time, without wake-ups and without the network. All that runs on the way counts:
// preview_driver steers, and lidar_driver, which is faster, has proposed and has been judged before it.
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/TruckCommand.h>

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
      : nh_(withQueue(ros::NodeHandle())),
        scan_(nh_.advertise<sensor_msgs::LaserScan>("scan", 1)),
        command_(nh_.subscribe("command", 10, &Stages::onCommand, this)) {}

  // Until the command comes, or long after it should have.
  void answer(const sensor_msgs::LaserScan::ConstPtr& scan) {
    queue_.callAvailable();  // what is older is not on this scan's account
    stamp_ = scan->header.stamp;
    answered_ = false;
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(0.02);
    started_ = cpuNow();
    scan_.publish(scan);
    while (!answered_ && ros::SteadyTime::now() < end) queue_.callAvailable();
  }

  void rest() { queue_.callAvailable(); }

 private:
  ros::NodeHandle withQueue(ros::NodeHandle nh) {
    nh.setCallbackQueue(&queue_);
    return nh;
  }
  ros::NodeHandle stage(const std::string& name) { return withQueue(ros::NodeHandle("~" + name)); }

  void onCommand(const TruckCommand& command) {
    if (answered_ || command.header.stamp != stamp_) return;
    answered_ = true;
    const std::int64_t taken = cpuNow() - started_;
    if (command.source == TruckCommand::SOURCE_PREVIEW_DRIVER) log_.add("pilot_cpu", stamp_, taken);
  }

  Log log_{ros::param::param<std::string>("~log", "")};
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::Publisher scan_;
  ros::Subscriber command_;
  shell::ScanFilterRos scan_filter_{nh_, stage("scan_filter")};
  shell::WallSegmentationRos wall_segmentation_{nh_, stage("wall_segmentation")};
  shell::CenterlineRos centerline_{nh_, stage("centerline")};
  shell::PreviewDriverRos preview_driver_{nh_, stage("preview_driver")};
  shell::LidarDriverRos lidar_driver_{nh_, stage("lidar_driver")};
  shell::ArbiterRos arbiter_{nh_, stage("arbiter")};
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
