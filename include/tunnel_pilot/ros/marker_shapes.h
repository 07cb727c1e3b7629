#pragma once

#include <std_msgs/ColorRGBA.h>
#include <visualization_msgs/Marker.h>

#include <string>

namespace tunnel_pilot::shell {

std_msgs::ColorRGBA color(float r, float g, float b, float a);

/// Red at `bad` and below, yellow halfway, green at `good` and above.
std_msgs::ColorRGBA trafficColor(double value, double bad, double good);

/// A marker to be added, at the header's frame's origin.
visualization_msgs::Marker marker(const std_msgs::Header& header, const std::string& ns, int id,
                                  int type);

/// Takes a marker away.
visualization_msgs::Marker removal(const visualization_msgs::Marker& of);

}  // namespace tunnel_pilot::shell
