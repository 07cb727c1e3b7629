#include "tunnel_pilot/ros/stopping_markers.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/ros/marker_shapes.h"

namespace tunnel_pilot::shell {
namespace {

using visualization_msgs::Marker;

constexpr double kBandStep = 1.0;                    // [m]
constexpr double kShortest = 0.1;                    // band that is drawn [m]
constexpr double kStopMargin = 0.5;                  // shown red [m]
constexpr double kRoom = 3.5;                        // shown green [m]
constexpr double kFreeHalf = 0.12, kStopHalf = 0.5;  // of the bands' widths [m]
constexpr double kFreeGate = 1.2, kStopGate = 0.6;   // heights [m]
constexpr double kGateHalf = 1.5;                    // of their widths [m]

// Of both edges, tail to front. Empty where there are not two points that differ.
geometry::Path middleOf(const ArbiterState& state) {
  std::vector<geometry::PathPoint> points;
  const std::size_t count = std::min(state.corridor_left.size(), state.corridor_right.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto& left = state.corridor_left[i];
    const auto& right = state.corridor_right[i];
    geometry::PathPoint point;
    point.x = 0.5 * (double{left.x} + right.x);
    point.y = 0.5 * (double{left.y} + right.y);
    if (!std::isfinite(point.x + point.y)) continue;
    if (!points.empty()) {
      geometry::PathPoint& last = points.back();
      const double way = std::hypot(point.x - last.x, point.y - last.y);
      if (way < 1e-3) continue;
      point.s = last.s + way;
      point.heading = last.heading = std::atan2(point.y - last.y, point.x - last.x);
    }
    points.push_back(point);
  }
  return points.size() < 2 ? geometry::Path() : geometry::Path(points);
}

geometry_msgs::Point beside(const geometry::PathPoint& place, double left, double height) {
  geometry_msgs::Point point;
  point.x = place.x - left * std::sin(place.heading);
  point.y = place.y + left * std::cos(place.heading);
  point.z = height;
  return point;
}

void addQuad(Marker& m, const geometry_msgs::Point& a, const geometry_msgs::Point& b,
             const geometry_msgs::Point& c, const geometry_msgs::Point& d) {
  m.points.insert(m.points.end(), {a, b, c, a, c, d});
}

struct Band {
  double from, length;  // along the path [m]
  double half_width;    // [m]
  double height;        // above the ground [m]
  double gate_height;   // [m]
};

void addBand(Marker& m, const geometry::Path& path, const Band& band) {
  const double to = std::min(band.from + band.length, path.length());
  if (!(to - band.from >= kShortest)) return;
  geometry::PathPoint last = path.at(band.from);
  for (double s = band.from; s < to;) {
    s = std::min(s + kBandStep, to);
    const geometry::PathPoint next = path.at(s);
    addQuad(m, beside(last, band.half_width, band.height), beside(last, -band.half_width, band.height),
            beside(next, -band.half_width, band.height), beside(next, band.half_width, band.height));
    last = next;
  }
  addQuad(m, beside(last, kGateHalf, band.height), beside(last, -kGateHalf, band.height),
          beside(last, -kGateHalf, band.height + band.gate_height),
          beside(last, kGateHalf, band.height + band.gate_height));
}

Marker emptyBand(const ArbiterState& state, const char* ns, const std_msgs::ColorRGBA& c) {
  Marker m = marker(state.header, ns, 0, Marker::TRIANGLE_LIST);
  m.header.frame_id = kBaseFrame;
  m.scale.x = m.scale.y = m.scale.z = 1.0;
  m.color = c;
  return m;
}

}  // namespace

std::vector<Marker> stoppingMarkers(const ArbiterState& state, double front_overhang) {
  const double margin = state.free_distance - state.stopping_distance;
  Marker free = emptyBand(state, "free_distance", color(1.0F, 1.0F, 1.0F, 0.6F));
  Marker stop = emptyBand(state, "stopping_distance",
                          trafficColor(std::isfinite(margin) ? margin : 0.0, kStopMargin, kRoom));
  const geometry::Path path = middleOf(state);
  if (!path.empty()) {
    const double nose = std::max(0.0, path.project({front_overhang, 0.0}).s);
    addBand(stop, path, {nose, state.stopping_distance, kStopHalf, 0.10, kStopGate});
    addBand(free, path, {nose, state.free_distance, kFreeHalf, 0.15, kFreeGate});
  }
  for (Marker* m : {&free, &stop}) m->colors.assign(m->points.size(), m->color);
  return {free.points.empty() ? removal(free) : free, stop.points.empty() ? removal(stop) : stop};
}

}  // namespace tunnel_pilot::shell
