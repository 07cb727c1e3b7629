#include "tunnel_pilot/ros/markers_ros.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tunnel_pilot/bridge/safety_state.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/parameters.h"

namespace tunnel_pilot::shell {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kPathSpacing = 0.2;       // of the driven path's points [m]
constexpr std::size_t kPathPoints = 3000;  // older ones are forgotten
constexpr double kNear = 0.2, kFar = 0.8;  // clearances shown red and green [m]

std_msgs::ColorRGBA color(float r, float g, float b, float a) {
  std_msgs::ColorRGBA c;
  c.r = r;
  c.g = g;
  c.b = b;
  c.a = a;
  return c;
}

const std_msgs::ColorRGBA kLeftColor = color(0.25F, 0.62F, 1.0F, 1.0F);
const std_msgs::ColorRGBA kRightColor = color(1.0F, 0.55F, 0.15F, 1.0F);
const std_msgs::ColorRGBA kPreviewColor = color(1.0F, 0.2F, 0.8F, 1.0F);
const std_msgs::ColorRGBA kPathColor = color(0.95F, 0.95F, 0.55F, 0.9F);
const std_msgs::ColorRGBA kTextColor = color(1.0F, 1.0F, 1.0F, 1.0F);

Marker marker(const std_msgs::Header& header, const std::string& ns, int id, int type) {
  Marker m;
  m.header = header;
  m.ns = ns;
  m.id = id;
  m.type = type;
  m.action = Marker::ADD;
  m.pose.orientation.w = 1.0;
  return m;
}

Marker removal(const Marker& of) {
  Marker m = of;
  m.points.clear();
  m.colors.clear();
  m.action = Marker::DELETE;
  return m;
}

geometry_msgs::Point raised(const geometry_msgs::Point32& point, double height) {
  geometry_msgs::Point p;
  p.x = point.x;
  p.y = point.y;
  p.z = height;
  return p;
}

void addWall(const Wall& wall, const std_msgs::Header& header, const std::string& ns,
             const std_msgs::ColorRGBA& c, MarkerArray& markers) {
  Marker points = marker(header, ns, 0, Marker::POINTS);
  points.scale.x = points.scale.y = 0.12;
  points.color = c;
  for (const auto& point : wall.points) points.points.push_back(raised(point, 0.6));
  Marker curve = marker(header, ns, 1, Marker::LINE_STRIP);
  curve.scale.x = 0.14;
  curve.color = c;
  for (const auto& point : wall.curve) curve.points.push_back(raised(point, 0.5));
  markers.markers.push_back(points.points.empty() ? removal(points) : points);
  markers.markers.push_back(curve.points.size() < 2 ? removal(curve) : curve);
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

// Red at kNear, yellow halfway, green at kFar.
std_msgs::ColorRGBA clearanceColor(double clearance) {
  const double share = std::clamp((clearance - kNear) / (kFar - kNear), 0.0, 1.0);
  return color(static_cast<float>(std::min(1.0, 2.0 - 2.0 * share)),
               static_cast<float>(std::min(1.0, 2.0 * share)), 0.15F, 0.75F);
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
    band.colors.push_back(clearanceColor(distance(point, wall)));
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

Marker stateText(const ArbiterState& state, const TruckStatus& status) {
  Marker text = marker(state.header, "state", 0, Marker::TEXT_VIEW_FACING);
  text.header.frame_id = kBaseFrame;
  text.scale.z = 0.9;
  text.color = kTextColor;
  text.pose.position.x = 3.0;  // beside the tunnel
  text.pose.position.y = 9.0;
  text.pose.position.z = 2.0;
  text.text =
      bridge::toString(static_cast<bridge::SafetyState>(status.state)) + ": " + state.reason_text;
  return text;
}

}  // namespace

MarkersRos::MarkersRos(ros::NodeHandle nh, ros::NodeHandle private_nh) {
  Parameters(private_nh).rest().finish();
  std_msgs::Header odom;
  odom.frame_id = kOdomFrame;
  driven_path_ = marker(odom, "driven_path", 0, Marker::LINE_STRIP);
  driven_path_.scale.x = 0.10;
  driven_path_.color = kPathColor;
  publisher_ = nh.advertise<MarkerArray>("markers", 10);
  walls_subscriber_ = nh.subscribe("walls", 1, &MarkersRos::onWalls, this);
  arbiter_subscriber_ = nh.subscribe("arbiter_state", 1, &MarkersRos::onArbiterState, this);
  proposal_subscriber_ = nh.subscribe("preview_driver/proposal", 1, &MarkersRos::onProposal, this);
  status_subscriber_ = nh.subscribe("truck_status", 1, &MarkersRos::onTruckStatus, this);
  odometry_subscriber_ = nh.subscribe("odom", 1, &MarkersRos::onOdometry, this);
}

void MarkersRos::publish(const MarkerArray& markers) const {
  if (publisher_.getNumSubscribers() > 0) publisher_.publish(markers);
}

void MarkersRos::onWalls(const Walls& message) {
  walls_ = message;
  MarkerArray markers;
  addWall(message.left, message.header, "wall_left", kLeftColor, markers);
  addWall(message.right, message.header, "wall_right", kRightColor, markers);
  publish(markers);
}

void MarkersRos::onArbiterState(const ArbiterState& message) {
  MarkerArray markers;
  markers.markers.push_back(corridor(message, walls_));
  markers.markers.push_back(stateText(message, truck_status_));
  publish(markers);
}

void MarkersRos::onProposal(const Proposal& message) {
  Marker point = marker(message.header, "preview_point", 0, Marker::SPHERE);
  point.header.frame_id = kBaseFrame;
  point.scale.x = point.scale.y = point.scale.z = 0.7;
  point.color = kPreviewColor;
  point.pose.position = message.preview_point;
  point.pose.position.z = 0.6;
  MarkerArray markers;
  markers.markers.push_back(message.has_preview_point ? point : removal(point));
  publish(markers);
}

void MarkersRos::onTruckStatus(const TruckStatus& message) { truck_status_ = message; }

void MarkersRos::onOdometry(const nav_msgs::Odometry& message) {
  auto& points = driven_path_.points;
  const auto& position = message.pose.pose.position;
  if (message.header.stamp < driven_path_.header.stamp) points.clear();  // the clock jumped back
  const bool moved = points.empty() || std::hypot(position.x - points.back().x,
                                                  position.y - points.back().y) > kPathSpacing;
  if (!moved) return;
  if (points.size() >= kPathPoints) points.erase(points.begin(), points.begin() + kPathPoints / 10);
  points.push_back(position);
  points.back().z = 0.1;
  driven_path_.header.stamp = message.header.stamp;
  MarkerArray markers;
  markers.markers.push_back(points.size() < 2 ? removal(driven_path_) : driven_path_);
  publish(markers);
}

}  // namespace tunnel_pilot::shell
