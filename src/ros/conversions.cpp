#include "tunnel_pilot/ros/conversions.h"

#include <pcl_conversions/pcl_conversions.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

namespace tunnel_pilot::shell {
namespace {

geometry_msgs::Point32 toPoint32(double x, double y) {
  geometry_msgs::Point32 point;
  point.x = static_cast<float>(x);
  point.y = static_cast<float>(y);
  return point;
}

perception::Wall toCore(const Wall& message) {
  perception::Wall wall;
  wall.found = message.found;
  wall.residual = message.residual;
  wall.curve.reserve(message.curve.size());
  for (const auto& point : message.curve) wall.curve.emplace_back(point.x, point.y);
  return wall;
}

Wall toRos(const perception::Wall& wall, const pcl::PointCloud<pcl::PointXYZ>& cloud) {
  Wall message;
  message.found = wall.found;
  message.residual = static_cast<float>(wall.residual);
  message.points.reserve(wall.indices.size());
  for (const int index : wall.indices) {
    const auto& point = cloud.points[static_cast<std::size_t>(index)];
    message.points.push_back(toPoint32(point.x, point.y));
  }
  message.curve.reserve(wall.curve.size());
  for (const auto& point : wall.curve) message.curve.push_back(toPoint32(point.x(), point.y()));
  return message;
}

// Where in a point its `name` stands, if it is a float.
std::optional<std::size_t> offsetOf(const sensor_msgs::PointCloud2& message, const char* name) {
  for (const auto& field : message.fields) {
    const std::uint64_t end = std::uint64_t{field.offset} + sizeof(float);
    const bool is_float = field.datatype == sensor_msgs::PointField::FLOAT32;
    if (field.name == name && is_float && end <= message.point_step) return field.offset;
  }
  return std::nullopt;
}

// Curvature in the middle of three samples, by the headings of its neighbours.
void rebuildCurvature(std::vector<geometry::PathPoint>& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& before = points[i == 0 ? 0 : i - 1];
    const auto& after = points[std::min(i + 1, points.size() - 1)];
    points[i].curvature = geometry::wrapAngle(after.heading - before.heading) / (after.s - before.s);
  }
}

}  // namespace

Stamp toCore(const ros::Time& time) {
  return std::chrono::seconds(time.sec) + std::chrono::nanoseconds(time.nsec);
}

ros::Time toRos(Stamp stamp) {
  ros::Time time;
  if (stamp.count() > 0) time.fromNSec(static_cast<std::uint64_t>(stamp.count()));
  return time;
}

Stamp now() { return toCore(ros::Time::now()); }

Stamp nowAfter(const ros::Time& stamp) {
  constexpr Stamp kOvertaken = std::chrono::milliseconds(50);  // beyond, not the clock is late
  if (!ros::Time::isSimTime() || toCore(stamp) > now() + kOvertaken) return now();
  const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(0.05);
  while (ros::Time::now() < stamp && ros::SteadyTime::now() < end) ros::WallDuration(0.0002).sleep();
  return now();
}

geometry::Pose toCore(const geometry_msgs::Pose& pose) {
  const auto& q = pose.orientation;
  const double heading = std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
  return {pose.position.x, pose.position.y, heading};
}

geometry_msgs::Pose toRos(const geometry::Pose& pose) {
  geometry_msgs::Pose message;
  message.position.x = pose.x;
  message.position.y = pose.y;
  message.orientation.z = std::sin(0.5 * pose.heading);
  message.orientation.w = std::cos(0.5 * pose.heading);
  return message;
}

geometry::Scan toCore(const sensor_msgs::LaserScan& message) {
  geometry::Scan scan;
  scan.stamp = toCore(message.header.stamp);
  scan.angle_min = message.angle_min;
  scan.angle_increment = message.angle_increment;
  scan.announced_angle_max = message.angle_max;
  scan.time_increment = message.time_increment;
  scan.range_min = message.range_min;
  scan.range_max = message.range_max;
  scan.ranges = message.ranges;
  return scan;
}

sensor_msgs::LaserScan toRos(const geometry::Scan& scan, const std::string& frame) {
  sensor_msgs::LaserScan message;
  message.header.stamp = toRos(scan.stamp);
  message.header.frame_id = frame;
  message.angle_min = static_cast<float>(scan.angle_min);
  message.angle_max = static_cast<float>(scan.angleMax());
  message.angle_increment = static_cast<float>(scan.angle_increment);
  message.time_increment = static_cast<float>(scan.time_increment);
  message.range_min = static_cast<float>(scan.range_min);
  message.range_max = static_cast<float>(scan.range_max);
  message.ranges = scan.ranges;
  return message;
}

// By hand: pcl::fromROSMsg takes ten times as long where a point has room for a fourth number, as PCL's
// own have.
pcl::PointCloud<pcl::PointXYZ>::Ptr toCore(const sensor_msgs::PointCloud2& message) {
  const auto x = offsetOf(message, "x");
  const auto y = offsetOf(message, "y");
  const auto z = offsetOf(message, "z");
  const std::uint64_t row = std::uint64_t{message.width} * message.point_step;
  const bool holds_all =
      row <= message.row_step && std::uint64_t{message.row_step} * message.height <= message.data.size();
  if (!x || !y || !z || !holds_all || message.is_bigendian) return nullptr;
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(
      new pcl::PointCloud<pcl::PointXYZ>(message.width, message.height));
  cloud->is_dense = message.is_dense != 0;
  auto point = cloud->points.begin();
  for (std::size_t first = 0; point != cloud->points.end(); first += message.row_step) {
    const std::uint8_t* at = &message.data[first];
    for (std::uint32_t column = 0; column < message.width; ++column, ++point, at += message.point_step) {
      std::memcpy(&point->x, at + *x, sizeof(float));
      std::memcpy(&point->y, at + *y, sizeof(float));
      std::memcpy(&point->z, at + *z, sizeof(float));
    }
  }
  return cloud;
}

sensor_msgs::PointCloud2 toRos(const pcl::PointCloud<pcl::PointXYZ>& cloud, Stamp stamp) {
  sensor_msgs::PointCloud2 message;
  pcl::toROSMsg(cloud, message);
  message.header.stamp = toRos(stamp);
  message.header.frame_id = kBaseFrame;
  return message;
}

perception::Walls toCore(const Walls& message) {
  perception::Walls walls;
  walls.stamp = toCore(message.header.stamp);
  walls.enough_returns = message.enough_returns;
  walls.left = toCore(message.left);
  walls.right = toCore(message.right);
  return walls;
}

Walls toRos(const perception::Walls& walls, const pcl::PointCloud<pcl::PointXYZ>& cloud) {
  Walls message;
  message.header.stamp = toRos(walls.stamp);
  message.header.frame_id = kBaseFrame;
  message.enough_returns = walls.enough_returns;
  message.left = toRos(walls.left, cloud);
  message.right = toRos(walls.right, cloud);
  return message;
}

perception::TunnelState toCore(const TunnelState& message) {
  perception::TunnelState state;
  state.stamp = toCore(message.header.stamp);
  state.valid = message.valid;
  state.reason = static_cast<perception::TunnelReason>(message.reason);
  state.lateral_offset = message.lateral_offset;
  state.heading_error = message.heading_error;
  state.curvature = message.curvature;
  state.width = message.width;
  std::copy(message.covariance.begin(), message.covariance.end(), state.covariance.begin());
  return state;
}

TunnelState toRos(const perception::TunnelState& state) {
  TunnelState message;
  message.header.stamp = toRos(state.stamp);
  message.header.frame_id = kBaseFrame;
  message.valid = state.valid;
  message.reason = static_cast<std::uint8_t>(state.reason);
  message.lateral_offset = state.lateral_offset;
  message.heading_error = state.heading_error;
  message.curvature = state.curvature;
  message.width = state.width;
  std::copy(state.covariance.begin(), state.covariance.end(), message.covariance.begin());
  return message;
}

geometry::Path toCore(const nav_msgs::Path& message) {
  std::vector<geometry::PathPoint> points;
  points.reserve(message.poses.size());
  for (const auto& stamped : message.poses) {
    const geometry::Pose pose = toCore(stamped.pose);
    if (!std::isfinite(pose.x + pose.y + pose.heading)) return {};
    double s = 0.0;
    if (!points.empty()) {
      const double step = std::hypot(pose.x - points.back().x, pose.y - points.back().y);
      if (!(step > 1e-6)) return {};
      s = points.back().s + step;
    }
    points.push_back({s, pose.x, pose.y, pose.heading, 0.0});
  }
  if (points.size() < 2) return {};
  rebuildCurvature(points);
  return geometry::Path(std::move(points));
}

nav_msgs::Path toRos(const geometry::Path& path, Stamp stamp) {
  nav_msgs::Path message;
  message.header.stamp = toRos(stamp);
  message.header.frame_id = kBaseFrame;
  message.poses.reserve(path.points().size());
  for (const auto& point : path.points()) {
    geometry_msgs::PoseStamped stamped;
    stamped.header = message.header;
    stamped.pose = toRos(geometry::Pose{point.x, point.y, point.heading});
    message.poses.push_back(stamped);
  }
  return message;
}

drivers::Proposal toCore(const Proposal& message) {
  drivers::Proposal proposal;
  proposal.stamp = toCore(message.header.stamp);
  proposal.valid = message.valid;
  proposal.articulation_angle = message.articulation_angle;
  proposal.speed = message.speed;
  proposal.confidence = message.confidence;
  if (message.has_preview_point) {
    proposal.preview_point = geometry::Point(message.preview_point.x, message.preview_point.y);
  }
  return proposal;
}

Proposal toRos(const drivers::Proposal& proposal) {
  Proposal message;
  message.header.stamp = toRos(proposal.stamp);
  message.header.frame_id = kBaseFrame;
  message.valid = proposal.valid;
  message.articulation_angle = proposal.articulation_angle;
  message.speed = proposal.speed;
  message.confidence = proposal.confidence;
  message.has_preview_point = proposal.preview_point.has_value();
  if (proposal.preview_point) {
    message.preview_point.x = proposal.preview_point->x();
    message.preview_point.y = proposal.preview_point->y();
  }
  return message;
}

drivers::Motion toMotion(const nav_msgs::Odometry& message) {
  drivers::Motion motion;
  motion.stamp = toCore(message.header.stamp);
  motion.pose = toCore(message.pose.pose);
  motion.speed = message.twist.twist.linear.x;
  motion.yaw_rate = message.twist.twist.angular.z;
  return motion;
}

sensor_msgs::JointState toJointState(const drivers::Motion& motion) {
  sensor_msgs::JointState message;
  message.header.stamp = toRos(motion.stamp);
  message.name = {kArticulationJoint};
  message.position = {motion.articulation};
  message.velocity = {motion.articulation_rate};
  return message;
}

nav_msgs::Odometry toRos(const bridge::Odometry& odometry) {
  const auto& motion = odometry.motion();
  nav_msgs::Odometry message;
  message.header.stamp = toRos(motion.stamp);
  message.header.frame_id = kOdomFrame;
  message.child_frame_id = kBaseFrame;
  message.pose.pose = toRos(motion.pose);
  message.twist.twist.linear.x = motion.speed;
  message.twist.twist.linear.y = motion.speed * std::tan(odometry.slip());
  message.twist.twist.angular.z = motion.yaw_rate;
  constexpr std::size_t kMeasured[] = {0, 1, 5};  // x, y, yaw of the six rows
  constexpr std::size_t kRows = 6;
  constexpr double kUnknown = 1e6;
  for (const std::size_t row : {2U, 3U, 4U}) {
    message.pose.covariance[row * kRows + row] = kUnknown;
    message.twist.covariance[row * kRows + row] = kUnknown;
  }
  const auto pose = odometry.poseCovariance();
  const auto twist = odometry.twistVariance();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      message.pose.covariance[kMeasured[i] * kRows + kMeasured[j]] = pose(i, j);
    }
    message.twist.covariance[kMeasured[i] * kRows + kMeasured[i]] = twist(i);
  }
  return message;
}

}  // namespace tunnel_pilot::shell
