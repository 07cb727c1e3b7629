#include "tunnel_pilot/drivers/articulation_profile.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_cursor.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::drivers {

void ArticulationProfile::build(const geometry::Path& path, const vehicle::TruckGeometry& truck,
                                double spacing) {
  samples_.clear();
  spacing_ = spacing;
  if (path.empty()) return;
  const double start = path.points().front().s;
  PathCursor cursor(path, start);
  const int steps = std::max(1, static_cast<int>(path.length() / spacing));
  double heading = cursor.headingAt(start);
  double articulation = vehicle::steadyArticulation(truck, path.points().front().curvature);
  for (int i = 0; i <= steps; ++i) {
    const double s = start + i * spacing;
    const double next_heading = cursor.headingAt(s + spacing);
    const double curvature = (next_heading - heading) / spacing;
    samples_.push_back({s, curvature, articulation});
    const double slope = vehicle::articulationSlope(truck, curvature, articulation);
    const double half =
        vehicle::articulationSlope(truck, curvature, articulation + 0.5 * spacing * slope);
    articulation =
        std::clamp(articulation + spacing * half, -truck.max_articulation, truck.max_articulation);
    heading = next_heading;
  }
}

double ArticulationProfile::indexOf(double s) const {
  return std::clamp((s - samples_.front().s) / spacing_, 0.0, static_cast<double>(samples_.size() - 1));
}

double ArticulationProfile::at(double s) const {
  const double u = indexOf(s);
  const auto i = static_cast<std::size_t>(u);
  const auto j = std::min(i + 1, samples_.size() - 1);
  const double t = u - static_cast<double>(i);
  return samples_[i].articulation + t * (samples_[j].articulation - samples_[i].articulation);
}

double ArticulationProfile::curvatureAt(double s) const {
  return samples_[static_cast<std::size_t>(indexOf(s))].curvature;
}

}  // namespace tunnel_pilot::drivers
