#include "tunnel_pilot/simulation/ideal_drive.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace tunnel_pilot::simulation {
namespace {

constexpr double kSpacing = 0.5;  // of the governor's profile, as in the arbiter [m]
constexpr double kStep = 0.25;    // [m]
constexpr double kBehind = 10.0;  // three lengths l_r: the profile's start has faded [m]
constexpr double kAhead = 60.0;   // braking from any speed begins nearer than this to its cause [m]

// The line from `from` to `to` as an open path of its own. Only arc lengths and curvatures are read from
// it, so that a lap may pass its own start.
geometry::Path unrolled(const geometry::Path& line, double from, double to) {
  std::vector<geometry::PathPoint> points;
  for (double s = from; s <= to; s += kStep) {
    geometry::PathPoint point = line.at(s);
    point.s = s - from;
    points.push_back(point);
  }
  return geometry::Path(std::move(points));
}

}  // namespace

double idealDriveTime(const geometry::Path& line, const IdealDrive& drive,
                      const supervision::SpeedGovernor& governor, const vehicle::TruckGeometry& truck) {
  drivers::ArticulationProfile profile;
  profile.build(unrolled(line, drive.station - kBehind, drive.station + drive.way + kAhead), truck,
                kSpacing);
  const double highest =
      std::min(drive.top_speed, governor.stoppingWithin(drive.sight - truck.front_overhang));
  double speed = drive.speed;
  double time = 0.0;
  for (double s = 0.0; s < drive.way; s += kStep) {
    const double step = std::min(kStep, drive.way - s);
    const double gained = std::sqrt(speed * speed + 2.0 * drive.acceleration * step);
    const double limit = governor.alongPath(profile, kBehind + s + step).speed;
    const double next = std::min({gained, highest, limit});
    time += 2.0 * step / (speed + next);
    speed = next;
  }
  return time;
}

}  // namespace tunnel_pilot::simulation
