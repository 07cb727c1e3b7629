#include "tunnel_pilot/supervision/command_limiter.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::supervision {
namespace {

constexpr double kLongestPause = 0.1;  // [s]

// Clamps and tells whether it had to.
double clamped(double value, double low, double high, bool& fired) {
  const double result = std::clamp(value, low, high);
  fired = fired || result != value;
  return result;
}

}  // namespace

CommandLimiterParameters loadCommandLimiter(config::Node node) {
  CommandLimiterParameters p{};
  p.max_articulation = node.number("max_articulation", "rad", 0.05, 1.2);
  p.max_articulation_rate = node.number("max_articulation_rate", "rad/s", 0.01, 2.0);
  p.max_lateral_acceleration = node.number("max_lateral_acceleration", "m/s^2", 0.1, 5.0);
  p.max_speed = node.number("max_speed", "m/s", 0.1, 15.0);
  p.max_acceleration = node.number("max_acceleration", "m/s^2", 0.05, 5.0);
  p.max_deceleration = node.number("max_deceleration", "m/s^2", 0.05, 5.0);
  p.max_jerk = node.number("max_jerk", "m/s^3", 0.1, 50.0);
  p.stop_deceleration = node.number("stop_deceleration", "m/s^2", 0.05, 10.0);
  node.finish();
  return p;
}

CommandLimiter::CommandLimiter(const CommandLimiterParameters& parameters,
                               const vehicle::TruckGeometry& geometry)
    : parameters_(parameters), geometry_(geometry) {}

void CommandLimiter::start(double articulation, double speed) {
  if (std::isfinite(articulation)) {
    articulation_ =
        std::clamp(articulation, -parameters_.max_articulation, parameters_.max_articulation);
  }
  if (std::isfinite(speed)) speed_ = std::clamp(speed, 0.0, parameters_.max_speed);
  acceleration_ = 0.0;
}

CommandLimiter::Result CommandLimiter::limit(const Request& request, double elapsed) {
  elapsed = std::isfinite(elapsed) ? std::clamp(elapsed, 0.0, kLongestPause) : 0.0;
  Result result;
  const bool was_stopping = request.stop;
  const double last_speed = speed_;
  articulation_ = limitAngle(request, elapsed, result.fired);
  speed_ = limitSpeed(request, elapsed, result.fired);
  if (was_stopping) {
    acceleration_ = 0.0;
  } else if (elapsed > 0.0) {
    acceleration_ = (speed_ - last_speed) / elapsed;
  }
  result.articulation = articulation_;
  result.speed = speed_;
  result.acceleration = request.stop          ? parameters_.stop_deceleration
                        : acceleration_ < 0.0 ? parameters_.max_deceleration
                                              : parameters_.max_acceleration;
  return result;
}

double CommandLimiter::limitAngle(const Request& request, double elapsed, Flags& fired) {
  double angle = request.articulation;
  if (!std::isfinite(angle)) {
    fired.not_finite = true;
    return articulation_;
  }
  angle = clamped(angle, -parameters_.max_articulation, parameters_.max_articulation, fired.angle);
  const double measured = std::isfinite(request.measured_speed) ? std::abs(request.measured_speed) : 0.0;
  const double speed = std::max(measured, speed_);
  if (speed > 0.0) {
    const double widest =
        vehicle::steadyArticulation(geometry_, parameters_.max_lateral_acceleration / (speed * speed));
    angle = clamped(angle, -widest, widest, fired.lateral_acceleration);
  }
  const double step = parameters_.max_articulation_rate * elapsed;
  return clamped(angle, articulation_ - step, articulation_ + step, fired.rate);
}

double CommandLimiter::limitSpeed(const Request& request, double elapsed, Flags& fired) {
  if (request.stop) return 0.0;
  double wanted = request.speed;
  if (!std::isfinite(wanted)) {
    fired.not_finite = true;
    wanted = 0.0;
  }
  wanted = clamped(wanted, 0.0, parameters_.max_speed, fired.speed);
  const double curvature = std::abs(vehicle::steadyCurvature(geometry_, articulation_));
  if (curvature * wanted * wanted > parameters_.max_lateral_acceleration) {
    fired.lateral_acceleration = true;
    wanted = std::sqrt(parameters_.max_lateral_acceleration / curvature);
  }
  if (elapsed <= 0.0) return speed_;
  const double change = wanted - speed_;
  double acceleration = clamped(change / elapsed, -parameters_.max_deceleration,
                                parameters_.max_acceleration, fired.acceleration);
  // The jerk limit also bounds the acceleration from which it can still be brought to zero in time.
  const double jerk_step = parameters_.max_jerk * elapsed;
  const double landing =
      std::max(jerk_step, std::sqrt(2.0 * parameters_.max_jerk * std::abs(change)) - jerk_step);
  acceleration = clamped(acceleration, -landing, landing, fired.jerk);
  acceleration = clamped(acceleration, acceleration_ - jerk_step, acceleration_ + jerk_step, fired.jerk);
  return std::clamp(speed_ + acceleration * elapsed, 0.0, parameters_.max_speed);
}

}  // namespace tunnel_pilot::supervision
