#include "tunnel_pilot/ros/scan_filter_ros.h"

#include <ros/console.h>

#include <boost/make_shared.hpp>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {

using perception::ScanFilter;

ScanFilterRos::ScanFilterRos(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : ScanFilterRos(nh, private_nh, Parameters(private_nh)) {}

ScanFilterRos::ScanFilterRos(ros::NodeHandle nh, const ros::NodeHandle& private_nh,
                             Parameters parameters)
    : publishers_(takePublisher(parameters, nh)),
      filter_(perception::loadScanFilter(parameters.rest())),
      scan_publisher_(nh.advertise<sensor_msgs::LaserScan>("scan_filtered", 1)),
      points_publisher_(nh.advertise<sensor_msgs::PointCloud2>("points", 1)),
      rejection_publisher_(nh.advertise<ScanRejection>("scan_rejected", 1)),
      scan_subscriber_(
          nh.subscribe("scan", 1, &ScanFilterRos::onScan, this, ros::TransportHints().tcpNoDelay())),
      diagnostics_(nh, private_nh, "scan_filter", [this](auto& status) { fillStatus(status); }) {}

void ScanFilterRos::onScan(const ScanEvent& event) {
  const sensor_msgs::LaserScan& message = *event.getConstMessage();
  const Stamp received = nowAfter(message.header.stamp);
  if (clock_.jumped()) {
    ROS_WARN("scan_filter: the clock jumped, starting anew");
    filter_.reset();
  }
  const std::string why = publishers_.whyRefused(event.getPublisherName(), ros::SteadyTime::now());
  if (!why.empty()) {
    ++foreign_;
    reject(message, "scan rejected: " + why);
    ROS_ERROR_THROTTLE(1.0, "scan_filter: %s", problem_.c_str());
    return;
  }
  const auto sensor = sensor_pose_.find(message.header.frame_id);
  if (!sensor) {
    reject(message, sensor_pose_.whyNot());
    ROS_ERROR_THROTTLE(1.0, "scan_filter: %s", problem_.c_str());
    return;
  }
  const auto& result = filter_.filter(toCore(message), *sensor, received);
  if (result.accepted) {
    problem_.clear();
    publish(result, message);
    return;
  }
  reject(message, "scan rejected: " + toString(result.rejection),
         result.rejection == ScanFilter::Rejection::kFrozen);
  ROS_WARN_THROTTLE(1.0, "scan_filter: %s", problem_.c_str());
}

void ScanFilterRos::reject(const sensor_msgs::LaserScan& scan, const std::string& why, bool frozen) {
  problem_ = why;
  ScanRejection rejection;
  rejection.header.stamp = ros::Time::now();  // the scan's own may be what is wrong with it
  rejection.header.frame_id = scan.header.frame_id;
  rejection.frozen = frozen;
  rejection.text = why;
  rejection_publisher_.publish(boost::make_shared<ScanRejection>(std::move(rejection)));
}

void ScanFilterRos::publish(const ScanFilter::Result& result, const sensor_msgs::LaserScan& source) {
  auto scan = toRos(result.network_scan, source.header.frame_id);
  scan.scan_time = source.scan_time;
  points_publisher_.publish(
      boost::make_shared<sensor_msgs::PointCloud2>(toRos(*result.points, toCore(source.header.stamp))));
  scan_publisher_.publish(boost::make_shared<sensor_msgs::LaserScan>(std::move(scan)));
}

void ScanFilterRos::fillStatus(Diagnostics::Status& status) const {
  if (problem_.empty()) {
    status.summary(Diagnostics::Status::OK, "scans accepted");
  } else {
    status.summary(Diagnostics::Status::ERROR, problem_);
  }
  status.add("accepted", filter_.accepted());
  status.add("rejected", filter_.rejected() + foreign_);
  if (foreign_ > 0) status.add("from the wrong nodes", foreign_);
  for (std::size_t i = 1; i < ScanFilter::kRejections; ++i) {
    const auto rejection = static_cast<ScanFilter::Rejection>(i);
    if (filter_.count(rejection) > 0) status.add(toString(rejection), filter_.count(rejection));
  }
}

}  // namespace tunnel_pilot::shell
