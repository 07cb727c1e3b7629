#pragma once

#include <cmath>
#include <deque>
#include <random>
#include <vector>

#include "tunnel_pilot/drivers/preview_driver.h"
#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/vehicle/plant.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// A closed loop of driver and plant alone, for tests: the path is sensed with noise every 29 ms and
/// told 40 ms later, motion every 20 ms with the errors of the truck's sensors, commands leave every 20
/// ms.
struct SensedPathDrive {
  geometry::Path path;
  geometry::Pose start;
  double speed = 3.0;      // [m/s], held
  double duration = 20.0;  // [s]
  double sight = 15.0;     // [m]
  std::uint32_t seed = 1;
  double offset_noise = 0.02;          // [m]
  double heading_noise = 0.0035;       // [rad]
  double articulation_bias = 0.00524;  // [rad]

  struct Result {
    double max = 0.0;           // |offset| [m]
    double rms = 0.0;           // [m]
    double heading_zero = 1e9;  // time of the heading's first zero [s]
    double settled = 0.0;       // time of the last |offset| >= 0.1 m [s]
    double overshoot = 0.0;     // beyond the path, seen from the start [m]
  };

  Result run(vehicle::Plant& plant, PathDriver& driver) const;
};

inline SensedPathDrive::Result SensedPathDrive::run(vehicle::Plant& plant, PathDriver& driver) const {
  constexpr double kStep = 0.001;
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  std::deque<std::pair<long, perception::Tunnel>> told;
  Motion motion;
  double command = 0.0;
  double sent = 0.0;
  double sum = 0.0;
  Result result;
  plant.reset(start, 0.0, speed);
  motion.pose = start;
  geometry::Pose last = start;
  double s = path.project(start.position()).s;
  const double side = path.project(start.position()).lateral_offset;
  const long steps = std::lround(duration / kStep);
  for (long i = 0; i < steps; ++i) {
    const vehicle::PlantState& state = plant.state();
    const Stamp now = fromSeconds(10.0 + i * kStep);
    const geometry::PathProjection foot = path.project(state.pose.position(), s, 5.0);
    s = foot.s;
    if (i % 20 == 0) {
      const double yaw_rate = state.yaw_rate + 0.001 * normal(engine);
      geometry::Pose driven = last.relative(state.pose);  // as odometry that sees the slip tells it
      driven.heading = i > 0 ? 0.02 * yaw_rate : 0.0;
      last = state.pose;
      motion = {now,
                motion.pose.compose(driven),
                1.005 * state.speed,
                yaw_rate,
                state.articulation + articulation_bias + 0.0017 * normal(engine),
                state.articulation_rate};
      sent = command;
    }
    if (i % 29 == 0) {
      perception::Tunnel tunnel;
      const double shift = offset_noise * normal(engine);
      const double turn = heading_noise * normal(engine);
      const geometry::Pose seen = geometry::Pose{path.at(s).x, path.at(s).y, foot.heading}.compose(
          {0.0, foot.lateral_offset + shift,
           geometry::wrapAngle(state.pose.heading - foot.heading) + turn});
      tunnel.state.stamp = now;
      tunnel.state.valid = true;
      tunnel.state.lateral_offset = foot.lateral_offset + shift;
      tunnel.state.heading_error = geometry::wrapAngle(seen.heading - foot.heading);
      tunnel.state.curvature = foot.curvature;
      std::vector<geometry::PathPoint> points;
      for (double ahead = -1.0; ahead < sight; ahead += 0.5) {
        const geometry::PathPoint p = path.at(std::max(0.0, s + ahead));
        if (!points.empty() && p.s - s <= points.back().s) continue;
        const geometry::Point local = seen.inverseTransform({p.x, p.y});
        points.push_back(
            {p.s - s, local.x(), local.y(), geometry::wrapAngle(p.heading - seen.heading), p.curvature});
      }
      tunnel.centerline = geometry::Path(points);
      told.emplace_back(i + 40, tunnel);
    }
    if (!told.empty() && told.front().first <= i) {
      const Proposal proposal = driver.propose(told.front().second, motion, now);
      if (proposal.valid) command = proposal.articulation_angle;
      told.pop_front();
    }
    plant.step({sent, 3.0 * (speed - state.speed)}, {}, kStep);

    const double offset = foot.lateral_offset;
    const double heading = geometry::wrapAngle(state.pose.heading - foot.heading);
    result.max = std::max(result.max, std::abs(offset));
    sum += offset * offset;
    if (std::abs(offset) >= 0.1) result.settled = i * kStep;
    if (offset * side < 0.0) result.overshoot = std::max(result.overshoot, std::abs(offset));
    if (result.heading_zero > duration && i > 200 && heading * start.heading <= 0.0) {
      result.heading_zero = i * kStep;
    }
  }
  result.rms = std::sqrt(sum / static_cast<double>(steps));
  return result;
}

}  // namespace tunnel_pilot::drivers
