#include "tunnel_pilot/supervision/speed_governor.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::supervision {
namespace {

constexpr double kStraight = 1e-6;  // [1/m], [rad/m]: no limit below

}  // namespace

std::string toString(SpeedLimit limit) {
  switch (limit) {
    case SpeedLimit::kNone:
      return "none";
    case SpeedLimit::kDriver:
      return "driver";
    case SpeedLimit::kLateralAcceleration:
      return "lateral_acceleration";
    case SpeedLimit::kArticulationRate:
      return "articulation_rate";
    case SpeedLimit::kSight:
      return "sight";
    case SpeedLimit::kObstacle:
      return "obstacle";
    case SpeedLimit::kDegraded:
      return "degraded";
    case SpeedLimit::kStop:
      return "stop";
    case SpeedLimit::kLimiter:
      return "acceleration";
  }
  return "unknown";
}

SpeedGovernorParameters loadSpeedGovernor(config::Node node) {
  SpeedGovernorParameters p{};
  p.max_speed = node.number("max_speed", "m/s", 0.1, 15.0);
  p.max_lateral_acceleration = node.number("max_lateral_acceleration", "m/s^2", 0.1, 5.0);
  p.max_articulation_rate = node.number("max_articulation_rate", "rad/s", 0.01, 2.0);
  p.rate_window = node.number("rate_window", "m", 0.5, 10.0);
  p.bend_deceleration = node.number("bend_deceleration", "m/s^2", 0.1, 5.0);
  p.sight_deceleration = node.number("sight_deceleration", "m/s^2", 0.1, 5.0);
  p.reaction_time = node.number("reaction_time", "s", 0.0, 3.0);
  p.sight_reserve = node.number("sight_reserve", "m", 0.0, 20.0);
  node.finish();
  return p;
}

double SpeedGovernor::brakingTo(double speed, double distance, double deceleration) const {
  const double reaction = deceleration * parameters_.reaction_time;
  const double from_here =
      -reaction + std::sqrt(reaction * reaction + speed * speed + 2.0 * deceleration * distance);
  return std::max(speed, from_here);
}

double SpeedGovernor::stoppingWithin(double distance) const {
  const double room = distance - parameters_.sight_reserve;
  if (!(room > 0.0)) return 0.0;
  return std::min(parameters_.max_speed, brakingTo(0.0, room, parameters_.sight_deceleration));
}

SpeedGovernor::Limit SpeedGovernor::alongPath(const drivers::ArticulationProfile& profile,
                                              double s) const {
  Limit lowest{parameters_.max_speed, SpeedLimit::kNone};
  const auto take = [&](double speed, double distance, SpeedLimit by) {
    if (speed >= lowest.speed) return;  // braking to it allows no less
    const double allowed = brakingTo(speed, distance, parameters_.bend_deceleration);
    if (allowed < lowest.speed) lowest = {allowed, by};
  };
  const auto& samples = profile.samples();
  if (samples.size() < 2) return lowest;
  const double spacing = samples[1].s - samples[0].s;
  const auto window = std::max<std::size_t>(
      1, std::min(samples.size() - 1, static_cast<std::size_t>(parameters_.rate_window / spacing)));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double distance = std::max(0.0, samples[i].s - s);
    if (samples[i].s + parameters_.rate_window < s) continue;
    const double curvature = std::abs(samples[i].curvature);
    if (curvature > kStraight && samples[i].s >= s) {
      take(std::sqrt(parameters_.max_lateral_acceleration / curvature), distance,
           SpeedLimit::kLateralAcceleration);
    }
    if (i + window >= samples.size()) continue;
    const double slope = std::abs(samples[i + window].articulation - samples[i].articulation) /
                         (spacing * static_cast<double>(window));
    if (slope > kStraight) {
      take(parameters_.max_articulation_rate / slope, distance, SpeedLimit::kArticulationRate);
    }
  }
  return lowest;
}

}  // namespace tunnel_pilot::supervision
