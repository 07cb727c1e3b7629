#include "tunnel_pilot/vehicle/steering_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

namespace tunnel_pilot::vehicle {
namespace {

constexpr double kDegree = 0.017453292519943295;
constexpr double kStep = 0.005;               // of the simulated answer [s]
constexpr double kWarmUp = 1.5;               // longer than what came before a stretch can act [s]
constexpr double kLeastStretch = 3.0;         // [s]
constexpr double kLeastRecord = 20.0;         // [s] explained; ten clusters
constexpr double kCluster = 2.0;              // [s]
constexpr double kLeastStep = 2.0 * kDegree;  // of the command ...
constexpr double kStepTime = 0.25;            // ... within this time [s]
constexpr std::size_t kLeastSteps = 5;        // to each side
constexpr double kVagueTime = 0.01;           // deviation with which a dead time is refused [s]
constexpr double kVagueLag = 0.06;            // ... a lag [1]
constexpr double kVagueRate = 0.05;           // ... a rate [1]
constexpr double kLeastSweep = 30.0 * kDegree;
constexpr double kSweepTurn = 2.0 * kDegree;  // by which a new sweep begins
constexpr double kSweepSpread = 0.1;          // [1] of the sweeps to one side
constexpr double kMostAngle = 90.0 * kDegree;
constexpr double kUnlimited = 20.0;     // [rad/s] no limit
constexpr double kStiff = 80.0;         // [rad/s] of a hinge that cannot be seen to give way
constexpr double kClearlySlower = 0.9;  // [1] than the command, for a limit to be the hydraulics'
constexpr double kBetter = 1.01;        // the squares' sum without a rate limit, if it is to be seen

enum Parameter { kDeadTime, kRate, kLag, kDeadBand, kBias, kFrequency, kDamping, kParameters };
using Vector = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
using Flags = std::array<bool, kParameters>;

const Vector kLow = (Vector() << 0.0, 0.01, 0.005, 0.0, -0.1, 4.0, 0.02).finished();
const Vector kHigh = (Vector() << 1.0, kUnlimited, 2.0, 0.05, 0.1, kStiff, 1.5).finished();
const Vector kDifference = (Vector() << 0.003, 0.002, 0.003, 0.0005, 0.001, 0.1, 0.01).finished();

std::string inWords(const char* format, double a, double b = 0.0) {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), format, a, b);
  return text.data();
}

// The model's answer to a record at the times of its measurements, without bias.
struct Answer {
  std::vector<double> angles;  // [rad]
  double fastest = 0.0;        // [rad/s]
};

double startOf(const SteeringRecord& record) {
  const std::size_t count = std::min<std::size_t>(record.measured.size(), 5);
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += record.measured[i].angle;
  return sum / static_cast<double>(count);
}

// The hinge between the cylinders and the bodies. With z' = omega^2 (a - g), g' = z + 2 zeta omega (a -
// g), by the implicit midpoint rule, which no stiffness can upset.
class Hinge {
 public:
  Hinge(double frequency, double damping, double angle)
      : stiffness_(0.5 * kStep * frequency * frequency),
        gain_(0.5 * kStep * (stiffness_ + 2.0 * damping * frequency)),
        angle_(angle) {}

  double step(double cylinders) {  // their angle in the step's middle
    const double middle = (angle_ + 0.5 * kStep * rate_ + gain_ * cylinders) / (1.0 + gain_);
    rate_ += 2.0 * stiffness_ * (cylinders - middle);
    return angle_ = 2.0 * middle - angle_;
  }

 private:
  double stiffness_, gain_, angle_;
  double rate_ = 0.0;
};

// The valve follows the delayed command. Commands come to effect at their own times, not at the steps',
// so that the answer changes smoothly with the dead time.
class Valve {
 public:
  Valve(const Vector& p, const std::vector<TimedAngle>& commands, double angle, double time)
      : p_(p), commands_(commands), angle_(angle), time_(time) {}

  double moveUntil(double time) {
    for (; next_ < commands_.size() && commands_[next_].time + p_[kDeadTime] <= time; ++next_) {
      follow(commands_[next_].time + p_[kDeadTime]);
    }
    follow(time);
    return angle_;
  }

 private:
  void follow(double time) {
    const double span = std::max(0.0, time - time_);
    const double demand = commands_[next_ > 0 ? next_ - 1 : 0].angle;  // the first holds before it came
    const double play = 0.5 * p_[kDeadBand];
    const double way = std::clamp(angle_, demand - play, demand + play) - angle_;
    angle_ += std::clamp(way, -p_[kRate] * span, p_[kRate] * span);
    time_ += span;
  }

  const Vector& p_;
  const std::vector<TimedAngle>& commands_;
  double angle_;
  double time_;
  std::size_t next_ = 0;
};

// The lag is solved exactly for a valve that moves evenly within the step.
void simulate(const Vector& p, const SteeringRecord& record, Answer& answer) {
  const double begin = record.measured.front().time;
  const double decay = std::exp(-kStep / p[kLag]);
  double cylinders = startOf(record) - p[kBias];
  double valve = cylinders;
  double angle = cylinders;
  Valve follower(p, record.commanded, valve, begin);
  Hinge hinge(p[kFrequency], p[kDamping], angle);
  std::size_t next = 0;
  for (std::size_t k = 1; next < record.measured.size(); ++k) {
    const double time = begin + static_cast<double>(k) * kStep;
    const double opened = follower.moveUntil(time);
    const double drift = (opened - valve) / kStep * p[kLag];
    const double moved = opened - drift + (cylinders - valve + drift) * decay;
    const double old = angle;
    angle = hinge.step(0.5 * (cylinders + moved));
    if (time >= begin + kWarmUp) {
      answer.fastest = std::max(answer.fastest, std::abs(moved - cylinders) / kStep);
    }
    valve = opened;
    cylinders = moved;
    for (; next < record.measured.size() && record.measured[next].time <= time; ++next) {
      answer.angles.push_back(angle - (angle - old) * (time - record.measured[next].time) / kStep);
    }
  }
}

// A movement of the command, from its beginning on.
struct Step {
  double time;
  bool left;
  double rate;  // the highest [rad/s]
};

std::vector<Step> stepsOf(const std::vector<TimedAngle>& commands) {
  std::vector<Step> steps;
  double going = 0.0;
  std::size_t first = 0;
  for (const TimedAngle& command : commands) {
    while (commands[first].time < command.time - kStepTime) ++first;
    const double change = command.angle - commands[first].angle;
    const double rate = std::abs(change) / kStepTime;
    if (std::abs(change) < 0.5 * kLeastStep) going = 0.0;
    if (change * going > 0.0) steps.back().rate = std::max(steps.back().rate, rate);
    if (std::abs(change) < kLeastStep || change * going > 0.0) continue;
    steps.push_back({commands[first].time, change > 0.0, rate});
    going = change;
  }
  return steps;
}

// All records as one problem of least squares.
class Problem {
 public:
  Problem(const std::vector<SteeringRecord>& records, TurnDirection direction) : records_(records) {
    std::size_t cluster = 0;
    for (const SteeringRecord& record : records) {
      const std::vector<Step> steps = stepsOf(record.commanded);
      for (const Step& step : steps) {
        ++(step.left ? left : right);
        asked_.push_back(step.rate);
      }
      const double begin = record.measured.front().time;
      for (const TimedAngle& sample : record.measured) {
        const auto after = std::find_if(steps.begin(), steps.end(),
                                        [&](const Step& step) { return step.time > sample.time; });
        const bool to_left = after != steps.begin() && std::prev(after)->left;
        const bool to_right = after != steps.begin() && !std::prev(after)->left;
        const bool wanted = direction == TurnDirection::kBoth ||
                            (direction == TurnDirection::kLeft ? to_left : to_right);
        explained_.push_back(wanted && sample.time >= begin + kWarmUp);
        cluster_.push_back(cluster + static_cast<std::size_t>((sample.time - begin) / kCluster));
      }
      cluster = cluster_.back() + 1;
    }
  }

  // Measurement less model, of what is to be explained.
  Eigen::VectorXd residuals(const Vector& p, Answer* told = nullptr) const {
    Answer answer;
    answer.angles.reserve(explained_.size());
    for (const SteeringRecord& record : records_) simulate(p, record, answer);
    Eigen::VectorXd left_over(
        static_cast<Eigen::Index>(std::count(explained_.begin(), explained_.end(), true)));
    std::size_t i = 0;
    Eigen::Index row = 0;
    for (const SteeringRecord& record : records_) {
      for (const TimedAngle& sample : record.measured) {
        if (explained_[i]) left_over[row++] = sample.angle - answer.angles[i] - p[kBias];
        ++i;
      }
    }
    if (told != nullptr) *told = std::move(answer);
    return left_over;
  }

  // Of the residuals by the parameters that are free; zero for the others.
  Eigen::Matrix<double, Eigen::Dynamic, kParameters> jacobian(const Vector& p, const Flags& free) const {
    Eigen::Matrix<double, Eigen::Dynamic, kParameters> slopes;
    const auto rows = std::count(explained_.begin(), explained_.end(), true);
    slopes.setZero(rows, kParameters);
    for (Eigen::Index i = 0; i < kParameters; ++i) {
      if (!free[static_cast<std::size_t>(i)]) continue;
      Vector up = p;
      Vector down = p;
      up[i] = std::min(p[i] + kDifference[i], kHigh[i]);
      down[i] = std::max(p[i] - kDifference[i], kLow[i]);
      slopes.col(i) = (residuals(up) - residuals(down)) / (up[i] - down[i]);
    }
    return slopes;
  }

  // Covariance of the free parameters, robust against residuals that depend on each other for less
  // than a cluster.
  Matrix covariance(const Vector& p, const Flags& free) const {
    const auto slopes = jacobian(p, free);
    const Eigen::VectorXd left_over = residuals(p);
    Matrix bread = slopes.transpose() * slopes;
    for (Eigen::Index i = 0; i < kParameters; ++i) bread(i, i) += bread(i, i) > 0.0 ? 0.0 : 1e-12;
    Matrix filling = Matrix::Zero();
    Vector sum = Vector::Zero();
    Eigen::Index row = 0;
    std::size_t clusters = 0;
    for (std::size_t i = 0; i < explained_.size(); ++i) {
      if (explained_[i]) {
        sum += slopes.row(row).transpose() * left_over[row];
        ++row;
      }
      if (i + 1 < cluster_.size() && cluster_[i + 1] == cluster_[i]) continue;
      filling += sum * sum.transpose();
      if (!sum.isZero()) ++clusters;
      sum.setZero();
    }
    const Matrix inverse = bread.ldlt().solve(Matrix::Identity());
    const double count = static_cast<double>(clusters);
    return inverse * filling * inverse * (count / std::max(1.0, count - kParameters));
  }

  std::size_t left = 0;
  std::size_t right = 0;

  // How fast the larger steps of the command move [rad/s]; their upper quartile, which the recording's
  // jitter does not lift.
  double asked() const {
    std::vector<double> rates = asked_;
    const auto at = rates.begin() + static_cast<std::ptrdiff_t>(3 * rates.size() / 4);
    std::nth_element(rates.begin(), at, rates.end());
    return *at;
  }

 private:
  std::vector<double> asked_;  // one a step
  const std::vector<SteeringRecord>& records_;
  std::vector<bool> explained_;       // one a measurement
  std::vector<std::size_t> cluster_;  // likewise
};

Vector refine(const Problem& problem, Vector p, const Flags& free) {
  constexpr int kRounds = 40;
  double damping = 1e-3;
  Eigen::VectorXd left_over = problem.residuals(p);
  for (int round = 0; round < kRounds && damping < 1e6; ++round) {
    const auto slopes = problem.jacobian(p, free);
    const Matrix normal = slopes.transpose() * slopes;
    const Vector gradient = slopes.transpose() * left_over;
    const double cost = left_over.squaredNorm();
    for (; damping < 1e6; damping *= 5.0) {
      Matrix damped = normal;
      for (Eigen::Index i = 0; i < kParameters; ++i) damped(i, i) += damping * normal(i, i) + 1e-12;
      const Vector step = damped.ldlt().solve(-gradient);
      const Vector tried = (p + step).cwiseMax(kLow).cwiseMin(kHigh);
      const Eigen::VectorXd answer = problem.residuals(tried);
      if (answer.squaredNorm() >= cost) continue;
      p = tried;
      left_over = answer;
      damping *= 0.2;
      break;
    }
    if (cost - left_over.squaredNorm() < 1e-7 * cost) break;
  }
  return p;
}

Vector bestOfGrid(const Problem& problem, double rate) {
  Vector best = Vector::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (const double dead_time : {0.05, 0.15, 0.3, 0.5, 0.8}) {
    for (const double lag : {0.05, 0.15, 0.3, 0.8}) {
      for (const double frequency : {10.0, 15.0, 30.0}) {
        Vector p;
        p << dead_time, rate, lag, 0.005, 0.0, frequency, 0.3;
        const double cost = problem.residuals(p).squaredNorm();
        if (cost >= least) continue;
        least = cost;
        best = p;
      }
    }
  }
  return best;
}

// A limit just above what the command asks for is a valley of its own, and so is one below: all are
// tried.
Vector bestOfStarts(const Problem& problem, const Flags& free) {
  Vector best = Vector::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (const double rate : {0.05, 0.1, 0.16, 0.21, 0.27, 0.4}) {
    const Vector p = refine(problem, bestOfGrid(problem, rate), free);
    const double cost = problem.residuals(p).squaredNorm();
    if (cost >= least) continue;
    least = cost;
    best = p;
  }
  return best;
}

double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  const Eigen::VectorXd x = a.array() - a.mean();
  const Eigen::VectorXd y = b.array() - b.mean();
  return x.dot(y) / std::max(1e-12, x.norm() * y.norm());
}

// An answer must follow what is measured; the usual hydraulics' does even where the truck's are others.
void checkFollows(const Problem& problem, const Vector& best) {
  Vector usual;
  usual << 0.17, kUnlimited, 0.2, 0.0, 0.0, kStiff, 1.0;
  Vector still = best;
  still[kRate] = 0.0;
  const Eigen::VectorXd measured = problem.residuals(still);
  const double likeness = correlation(measured, measured - problem.residuals(usual));
  if (likeness < -0.5) {
    throw CannotTell("the articulation turns against its command: check the sensor's sign");
  }
  if (correlation(measured, measured - problem.residuals(best)) < 0.8) {
    throw CannotTell("the measured articulation does not follow the command");
  }
}

// A limit is seen where the command was clearly faster (the bridge's own limit and jitter make what is
// sent a little slower than what is asked for), and where the record would be explained worse without
// it.
bool limitSeen(const Problem& problem, Vector p, Flags free) {
  if (p[kRate] > kClearlySlower * problem.asked()) return false;
  const double limited = problem.residuals(p).squaredNorm();
  p[kRate] = kUnlimited;
  free[kRate] = false;
  return problem.residuals(refine(problem, p, free)).squaredNorm() > kBetter * limited;
}

void refuseIfVague(Estimate& estimate, double limit, const char* what) {
  if (!estimate.known() || estimate.deviation <= limit) return;
  estimate.refusal = what;
}

void check(const std::vector<TimedAngle>& angles) {
  double last = -std::numeric_limits<double>::infinity();
  for (const TimedAngle& at : angles) {
    if (!std::isfinite(at.time) || !std::isfinite(at.angle)) {
      throw std::invalid_argument("the record holds numbers that are not finite");
    }
    if (at.time <= last) throw std::invalid_argument("the record's times do not grow");
    if (std::abs(at.angle) > kMostAngle) {
      throw std::invalid_argument(
          inWords("an angle of %.2f rad in the record: not in radians?", at.angle));
    }
    last = at.time;
  }
}

// Slope [rad/s] of the straight line through a sweep's middle half, where neither start nor stop act.
double slopeWithin(const std::vector<TimedAngle>& measured, const TimedAngle& from,
                   const TimedAngle& to) {
  const double first = from.angle + 0.25 * (to.angle - from.angle);
  const double last = from.angle + 0.75 * (to.angle - from.angle);
  double n = 0.0, t = 0.0, a = 0.0, tt = 0.0, ta = 0.0;
  for (const TimedAngle& at : measured) {
    if (at.time < from.time || at.time > to.time) continue;
    if (at.angle < std::min(first, last) || at.angle > std::max(first, last)) continue;
    const double time = at.time - from.time;
    n += 1.0;
    t += time;
    a += at.angle;
    tt += time * time;
    ta += time * at.angle;
  }
  return std::abs(n * ta - t * a) / std::max(1e-12, n * tt - t * t);
}

Estimate rateOf(const std::vector<double>& rates) {
  Estimate rate;
  if (rates.size() < 2) {
    rate.refusal = "less than two sweeps to this side";
    return rate;
  }
  const auto [slowest, fastest] = std::minmax_element(rates.begin(), rates.end());
  const double count = static_cast<double>(rates.size());
  for (const double one : rates) rate.value += one / count;
  for (const double one : rates) rate.deviation += (one - rate.value) * (one - rate.value);
  rate.deviation = std::sqrt(rate.deviation / (count - 1.0) / count);
  if (*fastest - *slowest > kSweepSpread * rate.value) {
    rate.refusal =
        "the sweeps differ by more than a tenth: the wheel was not held over, or oil is short";
  }
  return rate;
}

// What was found, and what of it is too vague.
SteeringFit describe(const Problem& problem, const Vector& p, const Flags& free, bool limited) {
  Answer answer;
  const Eigen::VectorXd left_over = problem.residuals(p, &answer);
  const Matrix covariance = problem.covariance(p, free);
  const auto estimate = [&](Parameter i) { return Estimate{p[i], std::sqrt(covariance(i, i)), ""}; };
  SteeringFit fit{estimate(kDeadTime), estimate(kRate), estimate(kLag), p[kDeadBand], p[kBias]};
  fit.hinge_frequency = p[kFrequency] / (2.0 * M_PI);
  fit.hinge_damping = p[kDamping];
  fit.samples = static_cast<std::size_t>(left_over.size());
  fit.residual = std::sqrt(left_over.squaredNorm() / static_cast<double>(left_over.size()));
  fit.fastest = answer.fastest;
  fit.left = problem.left;
  fit.right = problem.right;
  refuseIfVague(fit.dead_time, kVagueTime, "the steps are too few or too small to tell it");
  refuseIfVague(fit.lag, kVagueLag * fit.lag.value, "the steps are too few or too small to tell it");
  if (!limited) {
    const double least = std::min(fit.fastest, p[kRate]);
    fit.rate = {0.0, 0.0,
                inWords("the command did not ask for more than the hydraulics give: at least %.1f deg/s",
                        least / kDegree)};
  }
  refuseIfVague(fit.rate, kVagueRate * fit.rate.value,
                "too few steps were large and fast enough to tell it");
  return fit;
}

}  // namespace

void SteeringIdentification::add(const SteeringRecord& record) {
  check(record.commanded);
  check(record.measured);
  if (record.commanded.size() < 2 || record.measured.size() < 10) return;
  const double length = record.measured.back().time - record.measured.front().time;
  if (length < kLeastStretch) return;
  records_.push_back(record);
  duration_ += length - kWarmUp;
}

SteeringFit SteeringIdentification::fit(TurnDirection direction) const {
  if (duration_ < kLeastRecord) {
    throw CannotTell(inWords("the record is too short: %.0f s of the pilot's steering, %.0f needed",
                             duration_, kLeastRecord));
  }
  const Problem all(records_, TurnDirection::kBoth);
  if (all.left < kLeastSteps || all.right < kLeastSteps) {
    throw CannotTell(
        inWords("the command moves too evenly to tell dead time from lag: %.0f steps to the left and "
                "%.0f to the right",
                static_cast<double>(all.left), static_cast<double>(all.right)));
  }
  Flags free;
  free.fill(true);
  Vector p = bestOfStarts(all, free);
  checkFollows(all, p);
  const bool limited = limitSeen(all, p, free);
  const Problem problem(records_, direction);
  if (direction != TurnDirection::kBoth) {
    for (const Parameter shared : {kDeadBand, kBias, kFrequency, kDamping}) free[shared] = false;
    p = refine(problem, p, free);
  }
  return describe(problem, p, free, limited);
}

SweepRates sweepRates(const std::vector<TimedAngle>& measured) {
  check(measured);
  std::vector<double> left, right;
  TimedAngle low = measured.empty() ? TimedAngle{} : measured.front();
  TimedAngle high = low;
  const auto end = [&](const TimedAngle& from, const TimedAngle& to) {
    if (std::abs(to.angle - from.angle) < kLeastSweep) return;
    (to.angle > from.angle ? left : right).push_back(slopeWithin(measured, from, to));
  };
  bool rising = false, falling = false;
  for (const TimedAngle& at : measured) {
    if (at.angle < low.angle) low = at;
    if (at.angle > high.angle) high = at;
    if (!falling && high.angle - at.angle > kSweepTurn) {
      if (rising) end(low, high);
      falling = true;
      rising = false;
      low = at;
    }
    if (!rising && at.angle - low.angle > kSweepTurn) {
      if (falling) end(high, low);
      rising = true;
      falling = false;
      high = at;
    }
  }
  if (rising) end(low, high);
  if (falling) end(high, low);
  return {rateOf(left), rateOf(right)};
}

}  // namespace tunnel_pilot::vehicle
