#include "tunnel_pilot/drivers/steering_estimator.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/path_model.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr double kLongestPause = 0.1;     // [s] a command moves no further than in this time
constexpr double kPredictionStep = 0.03;  // [s]
constexpr double kSteady = 0.01;          // [rad] nearer to its command, the articulation stands
constexpr double kOutOfReach = 0.85;      // [1] of max_rate * lag: the articulation turns at its fastest
constexpr double kBoosted = 0.85;         // [1] of the lead that may be used; beyond it is boosted
constexpr double kSettling = 0.25;        // [s] that it then takes to be at that rate
// How fast a reversing command crosses the valve's dead band, in its own movements.
constexpr double kDeadBandGain = 2.0;

double gain(double elapsed, double memory) { return 1.0 - std::exp(-elapsed / std::max(memory, 1e-6)); }

}  // namespace

SteeringEstimatorParameters loadSteeringEstimator(config::Node& node) {
  SteeringEstimatorParameters p{};
  config::Node steering = node.child("steering");
  p.dead_time = steering.number("dead_time", "s", 0.0, 1.0);
  p.transport_delay = steering.number("transport_delay", "s", 0.0, 0.3);
  p.lag = steering.number("lag", "s", 0.02, 2.0);
  p.dead_band = steering.number("dead_band", "rad", 0.0, 0.05);
  p.lead = steering.number("lead", "rad", 0.01, 1.0);
  p.boost = steering.number("boost", "rad", 0.0, 1.0);
  p.max_rate = steering.number("max_rate", "rad/s", 0.01, 2.0);
  p.max_articulation = steering.number("max_articulation", "rad", 0.1, 1.2);
  steering.finish();
  config::Node fastest = node.child("fastest_rate");
  p.rate_time = fastest.number("time", "s", 0.05, 100.0);
  p.rate_change = fastest.number("slower", "1", 0.0, 0.5);
  fastest.finish();
  config::Node bias = node.child("articulation_bias");
  p.bias_time = bias.number("time", "s", 0.1, 100.0);
  p.max_bias = bias.number("max", "rad", 0.0, 0.1);
  bias.finish();
  p.yaw = loadYawObserver(node.child("yaw_response"));
  return p;
}

SteeringEstimator::SteeringEstimator(const SteeringEstimatorParameters& parameters,
                                     const vehicle::TruckGeometry& geometry)
    : parameters_(parameters), yaw_(parameters.yaw, geometry), max_rate_(parameters.max_rate) {}

void SteeringEstimator::reset() {
  last_time_.reset();
  last_motion_.reset();
  yaw_.reset();
  max_rate_ = parameters_.max_rate;
  out_of_reach_ = 0.0;
  bias_ = 0.0;
  play_ = 0.0;
}

void SteeringEstimator::observe(const Motion& motion) {
  if (!last_motion_) dropCommands(motion.articulation);
  const double passed = last_motion_ ? toSeconds(motion.stamp - last_motion_->stamp) : 0.0;
  if (last_motion_ && passed <= 0.0) return;
  if (passed > kLongestPause) dropCommands(motion.articulation);
  last_motion_ = motion;

  const double acting = commandActing(motion.stamp);
  learnMaxRate(acting - motion.articulation + bias_, passed);
  const double moving = acting - commanded_articulation_;
  commanded_articulation_ += gain(passed, parameters_.lag) * moving;
  if (std::abs(moving) < kSteady) {
    const double deviation = motion.articulation - commanded_articulation_;
    bias_ += gain(passed, parameters_.bias_time) * (deviation - bias_);
    bias_ = std::clamp(bias_, -parameters_.max_bias, parameters_.max_bias);
  }
  last_motion_->articulation -= bias_;
  yaw_.update(*last_motion_, passed);
}

// Only towards a command that stays out of reach does the articulation show how fast it can turn. A
// truck that could turn faster than believed is not asked to.
void SteeringEstimator::learnMaxRate(double lead, double passed) {
  const double rate = std::copysign(1.0, lead) * last_motion_->articulation_rate;
  const bool far = std::abs(lead) > kOutOfReach * max_rate_ * parameters_.lag && rate > 0.0;
  const bool fast = last_motion_->speed >= parameters_.yaw.least_speed;  // at rest the engine idles
  out_of_reach_ = far && fast ? out_of_reach_ + passed : 0.0;
  if (out_of_reach_ < kSettling) return;
  max_rate_ += gain(passed, parameters_.rate_time) * (rate - max_rate_);
  const double slowest = (1.0 - parameters_.rate_change) * parameters_.max_rate;
  max_rate_ = std::clamp(max_rate_, slowest, parameters_.max_rate);
}

double SteeringEstimator::articulationAhead(Stamp now) const {
  double articulation = last_motion_->articulation;
  const double span = std::clamp(toSeconds(now - last_motion_->stamp), 0.0, 0.3) + toSeconds(delay());
  const int steps = std::max(1, static_cast<int>(std::ceil(span / kPredictionStep)));
  const double step = span / steps;
  const double share = lagShare(step, parameters_.lag);
  const double most = max_rate_ * step;
  for (int i = 0; i < steps; ++i) {
    const double command = commandActing(last_motion_->stamp + fromSeconds((i + 0.5) * step));
    articulation += std::clamp(share * (command - articulation), -most, most);
  }
  return articulation;
}

double SteeringEstimator::elapsed(Stamp now) const {
  return last_time_ ? std::clamp(toSeconds(now - *last_time_), 0.0, kLongestPause) : 0.0;
}

Stamp SteeringEstimator::delay() const {
  return fromSeconds(parameters_.dead_time + parameters_.transport_delay);
}

double SteeringEstimator::commandGivenBefore(Stamp time) const {
  for (std::size_t age = 0; age < given_.size(); ++age) {
    const Given& given = given_[(newest_ + given_.size() - age) % given_.size()];
    if (given.time <= time) return given.command;
  }
  return given_[(newest_ + 1) % given_.size()].command;  // the oldest
}

void SteeringEstimator::dropCommands(double articulation) {
  given_.fill({Stamp::min(), articulation});
  commanded_articulation_ = articulation;
  play_ = 0.0;
}

double SteeringEstimator::give(double command, double meets, Stamp now) {
  // What leads the articulation by more than the lag explains would only have to be taken back.
  command = std::clamp(command, meets - parameters_.lead, meets + parameters_.lead);
  command = std::clamp(command, -parameters_.max_articulation, parameters_.max_articulation);
  const double half_band = 0.5 * parameters_.dead_band;
  play_ = std::clamp(play_ + kDeadBandGain * (command - newestCommand()), -half_band, half_band);
  newest_ = (newest_ + 1) % given_.size();
  given_[newest_] = {now, command};
  last_time_ = now;
  // The slowest steering has more lag than is believed, and keeps to its fastest rate only with more
  // lead. It is not planned with: the first step back takes it away.
  const double used = std::abs(command - meets) / parameters_.lead;
  const double share = std::clamp((used - kBoosted) / (1.0 - kBoosted), 0.0, 1.0);
  const double boost = std::copysign(share * parameters_.boost, command - meets);
  return std::clamp(command + play_ + boost, -parameters_.max_articulation,
                    parameters_.max_articulation);
}

}  // namespace tunnel_pilot::drivers
