#pragma once

#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>
#include <tunnel_pilot/TunnelState.h>
#include <tunnel_pilot/Walls.h>

#include <string>

#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/drivers/driver.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/perception/types.h"
#include "tunnel_pilot/supervision/arbiter.h"

namespace tunnel_pilot::shell {

inline constexpr char kBaseFrame[] = "base_link";
inline constexpr char kOdomFrame[] = "odom";
inline constexpr char kMapFrame[] = "map";
inline constexpr char kArticulationJoint[] = "articulation_joint";

/// Stamps pass unchanged, to the nanosecond. A negative stamp, which ROS has not, becomes zero.
Stamp toCore(const ros::Time& time);
ros::Time toRos(Stamp stamp);

/// ROS time now, as the core takes it.
Stamp now();

/// The same, on receipt of a message that was stamped then. In simulated time a message may overtake the
/// clock, which comes over another connection: it is waited for, at most 50 ms of steady time, unless
/// the stamp is more than 50 ms ahead; that is what the message says, and waiting would make it true.
Stamp nowAfter(const ros::Time& stamp);

geometry::Pose toCore(const geometry_msgs::Pose& pose);
geometry_msgs::Pose toRos(const geometry::Pose& pose);

geometry::Scan toCore(const sensor_msgs::LaserScan& message);
sensor_msgs::LaserScan toRos(const geometry::Scan& scan, const std::string& frame);

/// Clouds carry microseconds in PCL: the stamp goes beside them. Returns null when the message has no
/// x, y, z of type float32, or announces more bytes than it holds.
pcl::PointCloud<pcl::PointXYZ>::Ptr toCore(const sensor_msgs::PointCloud2& message);
sensor_msgs::PointCloud2 toRos(const pcl::PointCloud<pcl::PointXYZ>& cloud, Stamp stamp);

/// Walls lose their indices on the way (the message holds the points themselves).
perception::Walls toCore(const Walls& message);
Walls toRos(const perception::Walls& walls, const pcl::PointCloud<pcl::PointXYZ>& cloud);

perception::TunnelState toCore(const TunnelState& message);
TunnelState toRos(const perception::TunnelState& state);

/// A path message holds poses alone: arc length and curvature are rebuilt from positions and headings.
/// Empty when there are fewer than two poses, numbers are not finite or poses coincide.
geometry::Path toCore(const nav_msgs::Path& message);
nav_msgs::Path toRos(const geometry::Path& path, Stamp stamp);

drivers::Proposal toCore(const Proposal& message);
Proposal toRos(const drivers::Proposal& proposal);

supervision::Command toCore(const TruckCommand& message);
TruckCommand toRos(const supervision::Command& command);

ArbiterState toArbiterState(const supervision::Decision& decision);

/// Pose, speed and yaw rate; the articulation is not in the message (see MotionInput).
drivers::Motion toMotion(const nav_msgs::Odometry& message);

sensor_msgs::JointState toJointState(const drivers::Motion& motion);

/// With its covariance. What a truck on a plane does not measure (z, roll, pitch) has a variance of 1e6.
nav_msgs::Odometry toRos(const bridge::Odometry& odometry);
TruckStatus toRos(const bridge::BridgeStatus& status, Stamp stamp);

/// What the arbiter needs to know of the bridge.
supervision::TruckState toCore(const TruckStatus& message);

}  // namespace tunnel_pilot::shell
