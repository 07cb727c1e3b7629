#include "tunnel_pilot/ros/marker_shapes.h"

#include <algorithm>

namespace tunnel_pilot::shell {

using visualization_msgs::Marker;

std_msgs::ColorRGBA color(float r, float g, float b, float a) {
  std_msgs::ColorRGBA c;
  c.r = r;
  c.g = g;
  c.b = b;
  c.a = a;
  return c;
}

std_msgs::ColorRGBA trafficColor(double value, double bad, double good) {
  const double share = std::clamp((value - bad) / (good - bad), 0.0, 1.0);
  return color(static_cast<float>(std::min(1.0, 2.0 - 2.0 * share)),
               static_cast<float>(std::min(1.0, 2.0 * share)), 0.15F, 0.75F);
}

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

}  // namespace tunnel_pilot::shell
