#include "tunnel_pilot/drivers/preview_planner.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_cursor.h"

namespace tunnel_pilot::drivers {

struct PreviewPlanner::Linear {
  Eigen::Matrix4d state;  ///< d(next)/d(state)
  Vector rate;            ///< d(next)/d(command rate)
};

PreviewPlanner::PreviewPlanner(const TruckResponse& truck, const PreviewWeights& weights, double step)
    : truck_(truck), weights_(weights), step_(step), share_(lagShare(step, truck.lag)) {}

void PreviewPlanner::reset() { rates_.fill(0.0); }

void PreviewPlanner::resetToUnwinding(double command, double speed) {
  for (std::size_t k = 0; k < kStages; ++k) {
    const double limit = rateLimit(k, speed);
    rates_[k] = std::clamp(-command / step_, -limit, limit);
    command += step_ * rates_[k];
  }
}

PathState PreviewPlanner::advance(const PathState& now, double cos_heading_error, double command_rate,
                                  double speed, double curvature, const YawResponse& believed) const {
  return advancedOnPath(truck_, now, cos_heading_error, command_rate, speed, curvature, believed, step_,
                        share_);
}

PreviewPlanner::Linear PreviewPlanner::linearise(const PathState& now, double rate, double speed,
                                                 double curvature, const YawResponse& believed) const {
  const double rear = truck_.geometry.rear_axle_to_hinge;
  const double front = truck_.geometry.front_axle_to_hinge;
  // What follows a rate-limited command with a lag keeps to that rate: no clamp to differentiate.
  const double share = share_;
  const double turn_of_hinge = share * (now.command + 0.5 * rate * step_ - now.articulation);
  const double middle = now.articulation + 0.5 * turn_of_hinge;
  const double travel = speed * step_;
  const double gain_travel = believed.gain * travel;
  const double sine = std::sin(middle);
  const double cosine = std::cos(middle);
  const double arm = front * cosine + rear;
  // The turn's derivatives: by the middle articulation, and by the hinge's own turn.
  const double by_middle =
      (gain_travel * cosine * arm + (gain_travel * sine + rear * turn_of_hinge) * front * sine) /
      (arm * arm);
  const double by_hinge = 0.5 * by_middle + rear / arm;
  const Vector turn(0.0, 0.0, by_middle - by_hinge * share, by_hinge * share);
  const double turn_by_rate = 0.5 * step_ * by_hinge * share;

  const double room = curvatureRoom(curvature, now.offset);
  const double path_turn = curvature * travel / room;
  Vector growth = turn;
  growth[0] = -path_turn * curvature * std::cos(now.heading_error) / room;
  growth[1] = path_turn * std::sin(now.heading_error);
  const double slip = truck_.slip_compliance * speed / step_;
  const double half_tan = sine / (1.0 + cosine);  // tan(gamma / 2)
  const double crab = 0.5 * (believed.gain - 1.0) * (1.0 + half_tan * half_tan);
  const double slope = travel * std::cos(now.heading_error);

  Linear linear;
  Vector drift = 0.5 * growth - slip * turn;
  drift[2] += crab * (1.0 - 0.5 * share);
  drift[3] += crab * 0.5 * share;
  linear.state.row(0) = slope * drift.transpose();
  linear.state.row(1) = growth.transpose();
  linear.state.row(2) << 0.0, 0.0, -share, share;
  linear.state.row(3).setZero();
  linear.state.diagonal().array() += 1.0;
  linear.state(0, 1) += slope;
  const double drift_by_rate = (0.5 - slip) * turn_by_rate + crab * 0.25 * share * step_;
  linear.rate << slope * drift_by_rate, turn_by_rate, 0.5 * step_ * share, step_;
  return linear;
}

double PreviewPlanner::courseOffset(double speed, double curvature, const YawResponse& believed) const {
  const double wheelbase = truck_.geometry.front_axle_to_hinge + truck_.geometry.rear_axle_to_hinge;
  return truck_.slip_compliance * speed * speed * curvature +
         0.5 * (1.0 - believed.gain) * curvature * wheelbase / believed.gain;
}

double PreviewPlanner::stageCost(const PathState& state, double curvature, double speed,
                                 const YawResponse& believed) const {
  const double course = state.heading_error - courseOffset(speed, curvature, believed);
  return weights_.offset * state.offset * state.offset + weights_.heading * course * course;
}

double PreviewPlanner::roll(const PathState& now, const geometry::Path& path, double speed,
                            const YawResponse& believed, double correction) {
  PathCursor cursor(path, now.s);
  PathState state = now;
  double heading = cursor.headingAt(state.s);
  double sum = 0.0;
  const double rate_weight = rateWeight(speed);
  const double least_step = 0.1 * speed * step_;
  for (std::size_t k = 0; k < kStages; ++k) {
    if (correction > 0.0) {
      const PathState& before = nominal_[k];
      const Vector change(state.offset - before.offset, state.heading_error - before.heading_error,
                          state.articulation - before.articulation, state.command - before.command);
      rates_[k] = std::clamp(nominal_rates_[k] + correction * corrections_[k] + gains_[k].dot(change),
                             -rateLimit(k, speed), rateLimit(k, speed));
    }
    const double cosine = std::cos(state.heading_error);
    const double ahead = std::max(least_step, speed * step_ * cosine);
    const double next_heading = cursor.headingAt(state.s + ahead);
    curvatures_[k] = (next_heading - heading) / ahead;
    states_[k] = state;
    state = advance(state, cosine, rates_[k], speed, curvatures_[k], believed);
    heading = cursor.headingAt(state.s);
    const double factor = k + 1 == kStages ? weights_.terminal : 1.0;
    sum +=
        factor * stageCost(state, curvatures_[k], speed, believed) + rate_weight * rates_[k] * rates_[k];
  }
  states_[kStages] = state;
  return sum;
}

void PreviewPlanner::sweep(double speed, const YawResponse& believed) {
  const auto gradient = [&](std::size_t k, double factor) {
    const PathState& state = states_[k + 1];
    const double course = state.heading_error - courseOffset(speed, curvatures_[k], believed);
    return Vector(factor * weights_.offset * state.offset, factor * weights_.heading * course, 0.0, 0.0);
  };
  const double rate_weight = rateWeight(speed);
  Vector value = Vector::Zero();
  Eigen::Matrix4d curvature_of_value = Eigen::Matrix4d::Zero();
  for (std::size_t k = kStages; k-- > 0;) {
    const double factor = k + 1 == kStages ? weights_.terminal : 1.0;
    value += gradient(k, factor);
    curvature_of_value(0, 0) += factor * weights_.offset;
    curvature_of_value(1, 1) += factor * weights_.heading;

    const Linear linear = linearise(states_[k], rates_[k], speed, curvatures_[k], believed);
    const Vector by_rate = curvature_of_value * linear.rate;
    const double slope = rate_weight * rates_[k] + value.dot(linear.rate);
    const double bend = rate_weight + linear.rate.dot(by_rate);
    const Vector mixed = linear.state.transpose() * by_rate;
    const double free_correction = -slope / bend;
    const double limit = rateLimit(k, speed);
    corrections_[k] = std::clamp(free_correction, -limit - rates_[k], limit - rates_[k]);
    const bool clamped = corrections_[k] != free_correction;
    gains_[k] = clamped ? Vector::Zero().eval() : (-mixed / bend).eval();

    value = (linear.state.transpose() * value + mixed * corrections_[k]).eval();
    curvature_of_value =
        (linear.state.transpose() * curvature_of_value * linear.state + mixed * gains_[k].transpose())
            .eval();
  }
}

void PreviewPlanner::shift(double elapsed) {
  const double steps = std::clamp(elapsed / step_, 0.0, 1.0);
  for (std::size_t k = 0; k + 1 < kStages; ++k) rates_[k] += steps * (rates_[k + 1] - rates_[k]);
}

PathState PreviewPlanner::plannedAt(double time) const {
  const double steps = std::clamp(time / step_, 0.0, static_cast<double>(kStages));
  const auto k = std::min(static_cast<std::size_t>(steps), kStages - 1);
  const double share = steps - static_cast<double>(k);
  const auto between = [share](double a, double b) { return a + share * (b - a); };
  const PathState& a = states_[k];
  const PathState& b = states_[k + 1];
  return {between(a.s, b.s), between(a.offset, b.offset), between(a.heading_error, b.heading_error),
          between(a.articulation, b.articulation), between(a.command, b.command)};
}

double PreviewPlanner::plan(const PathState& now, const geometry::Path& path, double speed,
                            const YawResponse& believed, double elapsed) {
  shift(elapsed);
  const double before = roll(now, path, speed, believed, 0.0);
  sweep(speed, believed);
  nominal_ = states_;
  nominal_rates_ = rates_;
  cost_ = before;
  for (double correction = 1.0; correction >= least_correction_; correction *= 0.5) {
    const double after = roll(now, path, speed, believed, correction);
    if (!(after <= before)) continue;
    cost_ = after;
    return rates_[0];
  }
  states_ = nominal_;  // no better plan was found, or something is not finite
  rates_ = nominal_rates_;
  if (!std::isfinite(before)) reset();
  return rates_[0];
}

}  // namespace tunnel_pilot::drivers
