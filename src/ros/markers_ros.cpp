#include "tunnel_pilot/ros/markers_ros.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/marker_shapes.h"
#include "tunnel_pilot/ros/parameters.h"
#include "tunnel_pilot/ros/stopping_markers.h"

namespace tunnel_pilot::shell {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kPathSpacing = 0.2;       // of the driven path's points [m]
constexpr double kPathJump = 5.0;          // between two messages: the odometry began anew [m]
constexpr std::size_t kPathPoints = 3000;  // older ones are forgotten
constexpr double kNear = 0.2, kFar = 0.8;  // clearances shown red and green [m]
constexpr double kDriftWidth = 5.0;        // sizes below are for this width [m]
constexpr double kScaleShare = 0.02;       // of each width measured, in the scale of what is drawn
constexpr double kWallHeight = 1.5;        // of the faces drawn on the walls [m]
constexpr double kReplayScale = 0.5;       // largest scale of the text where nobody drives
constexpr double kFanBegin = 4.0;          // of the network's bars, before the front axle [m]
constexpr double kBarLength = 5.0;         // of a probability of 1 [m]
constexpr double kBarShare = 0.7;          // of the way to the next bar, wide where they begin
constexpr double kFanLifetime = 0.5;       // [s] ROS time
constexpr double kTextHeight = 0.85;       // of a line [m]
constexpr double kTextLifetime = 5.0;      // a dead pilot's last words are not kept [s] ROS time
constexpr double kTextPeriod = 0.1;        // [s] steady time
constexpr double kCorridorPeriod = 0.04;   // [s] steady time
constexpr double kSilent = 1.0;            // what is older is not told any more [s]

const std_msgs::ColorRGBA kLeftColor = color(0.25F, 0.62F, 1.0F, 1.0F);
const std_msgs::ColorRGBA kRightColor = color(1.0F, 0.55F, 0.15F, 1.0F);
const std_msgs::ColorRGBA kPreviewColor = color(1.0F, 0.2F, 0.8F, 1.0F);
const std_msgs::ColorRGBA kNetworkColor = color(0.35F, 0.95F, 0.95F, 0.9F);
const std_msgs::ColorRGBA kPathColor = color(0.95F, 0.95F, 0.55F, 0.9F);

geometry_msgs::Point raised(const geometry_msgs::Point32& point, double height) {
  geometry_msgs::Point p;
  p.x = point.x;
  p.y = point.y;
  p.z = height;
  return p;
}

// A face of this height that stands on a curve; translucent, without light and shade.
Marker face(const Marker& curve, int id, double height, float alpha) {
  Marker m = marker(curve.header, curve.ns, id, Marker::TRIANGLE_LIST);
  m.scale.x = m.scale.y = m.scale.z = 1.0;
  m.color = curve.color;
  m.color.a = alpha;
  const auto at = [](geometry_msgs::Point point, double z) {
    point.z = z;
    return point;
  };
  for (std::size_t i = 0; i + 1 < curve.points.size(); ++i) {
    const auto& a = curve.points[i];
    const auto& b = curve.points[i + 1];
    m.points.insert(m.points.end(), {at(a, 0.0), at(b, 0.0), at(b, height)});
    m.points.insert(m.points.end(), {at(a, 0.0), at(b, height), at(a, height)});
  }
  m.colors.assign(m.points.size(), m.color);
  return m;
}

void addWall(const Wall& wall, const std_msgs::Header& header, const std::string& ns,
             const std_msgs::ColorRGBA& c, double scale, MarkerArray& markers) {
  const double height = kWallHeight * scale;
  Marker points = marker(header, ns, 0, Marker::POINTS);
  points.scale.x = points.scale.y = 0.12 * scale;
  points.color = c;
  for (const auto& point : wall.points) points.points.push_back(raised(point, 0.5 * height));
  Marker curve = marker(header, ns, 1, Marker::LINE_STRIP);
  curve.scale.x = 0.10 * scale;
  curve.color = c;
  for (const auto& point : wall.curve) curve.points.push_back(raised(point, 0.5 * height));
  const Marker area = face(curve, 2, height, 0.45F);
  markers.markers.push_back(points.points.empty() ? removal(points) : points);
  markers.markers.push_back(curve.points.size() < 2 ? removal(curve) : curve);
  markers.markers.push_back(area.points.empty() ? removal(area) : area);
}

// Distance of a corridor's edge point to a wall's curve, by its samples and the middles between them
// [m].
double distance(const geometry_msgs::Point32& point, const Wall& wall) {
  double least = kFar;
  for (std::size_t i = 0; i < wall.curve.size(); ++i) {
    const auto& a = wall.curve[i];
    const auto& b = wall.curve[i + 1 < wall.curve.size() ? i + 1 : i];
    least =
        std::min({least, std::hypot(double{point.x} - a.x, double{point.y} - a.y),
                  std::hypot(point.x - 0.5 * (double{a.x} + b.x), point.y - 0.5 * (double{a.y} + b.y))});
  }
  return least;
}

// The band between both edges, as two triangles a step.
Marker corridor(const ArbiterState& state, const Walls& walls) {
  Marker band = marker(state.header, "corridor", 0, Marker::TRIANGLE_LIST);
  band.header.frame_id = kBaseFrame;
  band.scale.x = band.scale.y = band.scale.z = 1.0;
  band.color = color(1.0F, 1.0F, 1.0F, 0.45F);
  const auto& left = state.corridor_left;
  const auto& right = state.corridor_right;
  const std::size_t count = std::min(left.size(), right.size());
  const auto add = [&](const geometry_msgs::Point32& point, const Wall& wall) {
    band.points.push_back(raised(point, 0.05));
    band.colors.push_back(trafficColor(distance(point, wall), kNear, kFar));
  };
  for (std::size_t i = 0; i + 1 < count; ++i) {
    add(left[i], walls.left);
    add(right[i], walls.right);
    add(left[i + 1], walls.left);
    add(left[i + 1], walls.left);
    add(right[i], walls.right);
    add(right[i + 1], walls.right);
  }
  return band.points.empty() ? removal(band) : band;
}

std_msgs::ColorRGBA textColor(Gravity gravity) {
  switch (gravity) {
    case Gravity::kStandby:
      return color(0.7F, 0.75F, 0.8F, 1.0F);
    case Gravity::kLimited:
      return color(1.0F, 0.8F, 0.25F, 1.0F);
    case Gravity::kStopped:
      return color(1.0F, 0.4F, 0.35F, 1.0F);
    case Gravity::kNormal:
      break;
  }
  return color(1.0F, 1.0F, 1.0F, 1.0F);
}

geometry_msgs::Point polar(double angle, double distance) {
  geometry_msgs::Point p;
  p.x = distance * std::cos(angle);
  p.y = distance * std::sin(angle);
  p.z = 0.4;
  return p;
}

// The outputs, each in the direction of the articulation it stands for.
Marker fan(const Proposal& proposal, double scale) {
  Marker bars = marker(proposal.header, "network", 0, Marker::LINE_LIST);
  bars.header.frame_id = kBaseFrame;
  bars.lifetime = ros::Duration(kFanLifetime);
  bars.color = kNetworkColor;
  bars.scale.x = kBarShare * kFanBegin * scale * proposal.outputs_spacing;
  for (std::size_t i = 0; i < proposal.outputs.size(); ++i) {
    const double angle = proposal.outputs_first + static_cast<double>(i) * proposal.outputs_spacing;
    const double probability = std::clamp(static_cast<double>(proposal.outputs[i]), 0.02, 1.0);
    if (!std::isfinite(angle + probability)) continue;
    bars.points.push_back(polar(angle, kFanBegin * scale));
    bars.points.push_back(polar(angle, (kFanBegin + kBarLength * probability) * scale));
  }
  return bars.points.empty() || !(bars.scale.x > 0.0) ? removal(bars) : bars;
}

Marker decodedArrow(const Proposal& proposal, double scale) {
  Marker arrow = marker(proposal.header, "network", 1, Marker::ARROW);
  arrow.header.frame_id = kBaseFrame;
  arrow.lifetime = ros::Duration(kFanLifetime);
  arrow.color = kPathColor;
  arrow.scale.x = 0.25 * scale;  // shaft, head, head's length
  arrow.scale.y = 0.7 * scale;
  arrow.scale.z = 0.8 * scale;
  const double angle = proposal.articulation_angle;
  if (!proposal.valid || !std::isfinite(angle)) return removal(arrow);
  arrow.points = {polar(angle, kFanBegin * scale), polar(angle, (kFanBegin + 1.2 * kBarLength) * scale)};
  return arrow;
}

// Beside the tunnel on the left, where it hides neither the truck nor its way.
Marker statusMarker(const StatusText& status, double scale) {
  std_msgs::Header header;  // without a stamp: at the latest transform
  header.frame_id = kBaseFrame;
  Marker text = marker(header, "status", 0, Marker::TEXT_VIEW_FACING);
  text.frame_locked = true;
  text.lifetime = ros::Duration(kTextLifetime);
  text.scale.z = kTextHeight * scale;
  text.color = textColor(status.gravity);
  text.pose.position.x = 1.0 * scale;
  text.pose.position.y = 11.0 * scale;
  text.pose.position.z = 2.0 * scale;
  text.text = status.text;
  return text;
}

}  // namespace

MarkersRos::MarkersRos(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  Parameters parameters(private_nh);
  front_overhang_ = takeTruck(parameters).geometry.front_overhang;
  parameters.rest().finish();
  std_msgs::Header odom;
  odom.frame_id = kOdomFrame;
  driven_path_ = marker(odom, "driven_path", 0, Marker::LINE_STRIP);
  driven_path_.scale.x = 0.10;
  driven_path_.color = kPathColor;
  publisher_ = nh.advertise<MarkerArray>("markers", 10);
  walls_subscriber_ = nh.subscribe("walls", 1, &MarkersRos::onWalls, this);
  tunnel_subscriber_ = nh.subscribe("tunnel_state", 1, &MarkersRos::onTunnelState, this);
  arbiter_subscriber_ = nh.subscribe("arbiter_state", 1, &MarkersRos::onArbiterState, this);
  command_subscriber_ = nh.subscribe("command", 1, &Latest<TruckCommand>::set, &command_);
  proposal_subscriber_ = nh.subscribe("preview_driver/proposal", 1, &MarkersRos::onProposal, this);
  network_subscriber_ = nh.subscribe("lidar_driver/proposal", 1, &MarkersRos::onNetwork, this);
  status_subscriber_ = nh.subscribe("truck_status", 1, &MarkersRos::onTruckStatus, this);
  odometry_subscriber_ = nh.subscribe("odom", 1, &MarkersRos::onOdometry, this);
  timer_ = nh.createWallTimer(ros::WallDuration(kTextPeriod),
                              [this](const ros::WallTimerEvent&) { publishStatus(); });
}

void MarkersRos::onWalls(const Walls& message) {
  walls_ = message;
  if (!isSeen()) return;
  MarkerArray markers;
  addWall(message.left, message.header, "wall_left", kLeftColor, scale_, markers);
  addWall(message.right, message.header, "wall_right", kRightColor, scale_, markers);
  publisher_.publish(markers);
}

void MarkersRos::onTunnelState(const TunnelState& message) {
  tunnel_state_.set(message);
  if (!message.valid || !std::isfinite(message.width)) return;
  const double scale = std::clamp(message.width / kDriftWidth, 0.2, 1.0);
  scale_ += (is_scaled_ ? kScaleShare : 1.0) * (scale - scale_);
  is_scaled_ = true;
}

void MarkersRos::onArbiterState(const ArbiterState& message) {
  arbiter_state_.set(message);
  const auto now = ros::SteadyTime::now();
  if (!isSeen() || (now - corridor_drawn_).toSec() < kCorridorPeriod) return;
  corridor_drawn_ = now;
  MarkerArray markers;
  markers.markers = stoppingMarkers(message, front_overhang_);
  markers.markers.push_back(corridor(message, walls_));
  publisher_.publish(markers);
}

void MarkersRos::onProposal(const Proposal& message) {
  if (!isSeen()) return;
  Marker point = marker(message.header, "preview_point", 0, Marker::SPHERE);
  point.header.frame_id = kBaseFrame;
  point.scale.x = point.scale.y = point.scale.z = 0.7;
  point.color = kPreviewColor;
  point.pose.position = message.preview_point;
  point.pose.position.z = 0.6;
  MarkerArray markers;
  markers.markers.push_back(message.has_preview_point ? point : removal(point));
  publisher_.publish(markers);
}

void MarkersRos::onNetwork(const Proposal& message) {
  network_.set(message);
  if (!isSeen()) return;
  MarkerArray markers;
  markers.markers.push_back(fan(message, scale_));
  markers.markers.push_back(decodedArrow(message, scale_));
  publisher_.publish(markers);
}

void MarkersRos::onTruckStatus(const TruckStatus& message) {
  const auto before = truck_status_.get(kSilent);
  truck_status_.set(message);
  if (message.state != TruckStatus::STATE_ARMED || !before || before->state == message.state) return;
  driven_path_.points.clear();  // a new drive begins
  publishDrivenPath();
}

void MarkersRos::onOdometry(const nav_msgs::Odometry& message) {
  odometry_.set(message);
  auto& points = driven_path_.points;
  const auto& position = message.pose.pose.position;
  if (!std::isfinite(position.x + position.y)) return;
  const double way =
      points.empty() ? 0.0 : std::hypot(position.x - points.back().x, position.y - points.back().y);
  if (message.header.stamp < driven_path_.header.stamp || way > kPathJump) points.clear();
  if (!points.empty() && way < kPathSpacing) return;
  if (points.size() >= kPathPoints) points.erase(points.begin(), points.begin() + kPathPoints / 10);
  points.push_back(position);
  points.back().z = 0.1;
  driven_path_.header.stamp = message.header.stamp;
  publishDrivenPath();
}

void MarkersRos::publishDrivenPath() {
  if (!isSeen()) return;
  MarkerArray markers;
  driven_path_.scale.x = 0.12 * scale_;
  markers.markers.push_back(driven_path_.points.size() < 2 ? removal(driven_path_) : driven_path_);
  publisher_.publish(markers);
}

void MarkersRos::publishStatus() {
  if (!isSeen()) return;
  const auto arbiter = arbiter_state_.get(kSilent);
  const auto status =
      describe({truck_status_.get(kSilent), arbiter, command_.get(kSilent), tunnel_state_.get(kSilent),
                odometry_.get(kSilent), network_.get(kSilent)});
  // A recording without a truck is looked at from nearer.
  const Marker text = statusMarker(status, arbiter ? scale_ : std::min(scale_, kReplayScale));
  MarkerArray markers;
  markers.markers.push_back(status.text.empty() ? removal(text) : text);
  publisher_.publish(markers);
}

}  // namespace tunnel_pilot::shell
