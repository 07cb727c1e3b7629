#include "tunnel_pilot/learning/demonstration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::learning {
namespace {

constexpr Stamp kLongestGap = std::chrono::milliseconds(150);  // between motions
constexpr Stamp kHalfWindow = std::chrono::milliseconds(500);  // of the fits through the offsets
constexpr double kLeastMeasured = 0.6;  // of a window's scans in which the tunnel was measured
constexpr double kSettlingWays = 3.0;   // lengths l_r after which a wrong start of g is forgotten
constexpr Stamp kMemory = std::chrono::seconds(3);

double mixed(double a, double b, double share) { return a + share * (b - a); }

// The last element at or before `stamp` and the one behind it; none outside.
template <typename Sequence, typename StampOf>
std::optional<std::pair<std::size_t, double>> placeIn(const Sequence& sequence, Stamp stamp,
                                                      StampOf stampOf) {
  const auto after = std::lower_bound(sequence.begin(), sequence.end(), stamp,
                                      [&](const auto& item, Stamp s) { return stampOf(item) < s; });
  if (after == sequence.end()) return std::nullopt;
  if (stampOf(*after) == stamp)
    return std::pair{static_cast<std::size_t>(after - sequence.begin()), 0.0};
  if (after == sequence.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const Stamp gap = stampOf(*after) - stampOf(*before);
  if (gap > kLongestGap) return std::nullopt;
  return std::pair{static_cast<std::size_t>(before - sequence.begin()),
                   toSeconds(stamp - stampOf(*before)) / toSeconds(gap)};
}

}  // namespace

DemonstrationParameters demonstrationParameters(const drivers::SteeringEstimatorParameters& steering,
                                                double scan_delay) {
  constexpr double kLeastSpeed = 0.5;
  const double acts_after = steering.transport_delay + steering.dead_time;
  return {scan_delay,   acts_after,  scan_delay + acts_after + steering.lag,
          steering.lag, kLeastSpeed, steering.max_rate,
          steering.yaw};
}

Demonstration::Demonstration(const DemonstrationParameters& parameters,
                             const vehicle::TruckGeometry& truck)
    : parameters_(parameters), truck_(truck), yaw_(parameters.yaw, truck) {}

void Demonstration::reset() {
  yaw_.reset();
  motions_.clear();
  places_.clear();
  next_place_ = 0;
  deviations_.clear();
  pending_.clear();
}

std::vector<Lesson> Demonstration::take() { return std::exchange(lessons_, {}); }

void Demonstration::addMotion(const drivers::Motion& motion) {
  if (!drivers::isUsable(motion)) return;
  if (!motions_.empty()) {
    const Stamp passed = motion.stamp - motions_.back().motion.stamp;
    if (passed <= Stamp::zero()) return;
    yaw_.update(motion, std::min(toSeconds(passed), toSeconds(kLongestGap)));
  }
  motions_.push_back({motion, yaw_.response()});
  measureDeviations();
  finishPending();
  forgetOld();
}

void Demonstration::addScan(const geometry::Scan& scan, const std::optional<double>& offset,
                            std::uint32_t tunnel) {
  if (!places_.empty() && scan.stamp <= places_.back().stamp) return;
  places_.push_back({scan.stamp, offset && std::isfinite(*offset)
                                     ? *offset
                                     : std::numeric_limits<double>::quiet_NaN()});
  Pending pending{scan.stamp, {}};
  pending.example.ranges = scan.ranges;
  pending.example.tunnel = tunnel;
  pending_.push_back(std::move(pending));
}

std::optional<Demonstration::Moment> Demonstration::momentAt(Stamp stamp) const {
  const auto place = placeIn(motions_, stamp, [](const Moment& m) { return m.motion.stamp; });
  if (!place) return std::nullopt;
  Moment moment = motions_[place->first];
  if (place->second == 0.0) return moment;
  const drivers::Motion& after = motions_[place->first + 1].motion;
  drivers::Motion& motion = moment.motion;
  motion.stamp = stamp;
  motion.speed = mixed(motion.speed, after.speed, place->second);
  motion.yaw_rate = mixed(motion.yaw_rate, after.yaw_rate, place->second);
  motion.articulation = mixed(motion.articulation, after.articulation, place->second);
  return moment;
}

std::optional<Demonstration::Deviation> Demonstration::deviationAt(Stamp stamp) const {
  const auto place = placeIn(deviations_, stamp, [](const Deviation& d) { return d.stamp; });
  if (!place) return std::nullopt;
  Deviation deviation = deviations_[place->first];
  if (place->second == 0.0) return deviation;
  const Deviation& after = deviations_[place->first + 1];
  deviation.offset = mixed(deviation.offset, after.offset, place->second);
  deviation.course = mixed(deviation.course, after.course, place->second);
  deviation.articulation = mixed(deviation.articulation, after.articulation, place->second);
  deviation.way = std::min(deviation.way, after.way);
  return deviation;
}

// A parabola through the offsets about a scan: its value and slope there.
std::optional<Demonstration::Deviation> Demonstration::fitted(std::size_t middle) const {
  const Stamp stamp = places_[middle].stamp;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int scans = 0;
  int measured = 0;
  for (const Place& place : places_) {
    const Stamp away = place.stamp - stamp;
    if (away < -kHalfWindow || away > kHalfWindow) continue;
    ++scans;
    if (std::isnan(place.offset)) continue;
    ++measured;
    const double t = toSeconds(away);
    const Eigen::Vector3d powers(1.0, t, t * t);
    normal += powers * powers.transpose();
    right += powers * place.offset;
  }
  if (measured < 8 || measured < kLeastMeasured * scans) return std::nullopt;
  const Eigen::Vector3d parabola = normal.ldlt().solve(right);
  const std::optional<Moment> moment = momentAt(stamp);
  if (!moment || !(moment->motion.speed >= parameters_.least_speed)) return std::nullopt;
  Deviation deviation{stamp, parabola[0], 0.0, 0.0, 0.0};
  deviation.course = std::asin(std::clamp(parabola[1] / moment->motion.speed, -1.0, 1.0));
  return deviation;
}

void Demonstration::measureDeviations() {
  const double arm = truck_.front_axle_to_hinge + truck_.rear_axle_to_hinge;
  const Stamp known =
      std::min(motions_.back().motion.stamp, places_.empty() ? Stamp{} : places_.back().stamp);
  for (; next_place_ < places_.size() && places_[next_place_].stamp + kHalfWindow <= known;
       ++next_place_) {
    std::optional<Deviation> now = fitted(next_place_);
    if (!now) continue;
    if (!deviations_.empty() && now->stamp - deviations_.back().stamp <= kLongestGap) {
      const Deviation& last = deviations_.back();
      const drivers::Motion motion = momentAt(now->stamp)->motion;
      const double way = motion.speed * toSeconds(now->stamp - last.stamp);
      const double curvature = vehicle::steadyCurvature(truck_, motion.articulation);
      const double turn = now->course - last.course + now->offset * curvature * curvature * way;
      const double keep = std::exp(-way / truck_.rear_axle_to_hinge);
      // Linear over the step: l_r g' = arm turn' - g.
      now->articulation = keep * last.articulation + arm * turn * (1.0 - keep) / std::max(way, 1e-6);
      now->way = last.way + way;
    }
    deviations_.push_back(*now);
  }
}

void Demonstration::finishPending() {
  const Stamp motions = motions_.back().motion.stamp;
  const Stamp reach = fromSeconds(parameters_.label_after);
  // A scan's correction is known when a window's half has passed behind its label, and a scan or two
  // more.
  const Stamp wait = reach + kHalfWindow + 2 * kLongestGap;
  while (!pending_.empty() && pending_.front().stamp + wait <= motions) {
    std::optional<Lesson> lesson = lessonOf(pending_.front());
    if (lesson) lessons_.push_back(std::move(*lesson));
    pending_.pop_front();
  }
}

std::optional<Lesson> Demonstration::lessonOf(Pending& pending) const {
  const Stamp seen = pending.stamp + fromSeconds(parameters_.seen_after);
  const std::optional<Moment> now = momentAt(seen);
  const std::optional<Moment> ahead = momentAt(seen + fromSeconds(parameters_.acts_after));
  const std::optional<Moment> label = momentAt(pending.stamp + fromSeconds(parameters_.label_after));
  if (!now || !ahead || !label) return std::nullopt;
  if (!(std::min(now->motion.speed, label->motion.speed) >= parameters_.least_speed))
    return std::nullopt;
  Lesson lesson{std::move(pending.example), {}, 0.0F};
  lesson.example.articulation = static_cast<float>(now->motion.articulation);
  lesson.example.articulation_ahead = static_cast<float>(ahead->motion.articulation);
  lesson.example.speed = static_cast<float>(now->motion.speed);
  lesson.example.yaw_gain = static_cast<float>(now->yaw.gain);
  lesson.example.yaw_disturbance = static_cast<float>(now->yaw.disturbance);
  lesson.example.steering_rate = static_cast<float>(parameters_.max_rate);
  lesson.example.label = static_cast<float>(label->motion.articulation);
  correct(pending.stamp, lesson);
  return lesson;
}

void Demonstration::correct(Stamp scan, Lesson& lesson) const {
  const Stamp acts = scan + fromSeconds(parameters_.seen_after + parameters_.acts_after);
  const std::optional<Deviation> at_label = deviationAt(scan + fromSeconds(parameters_.label_after));
  const std::optional<Deviation> at_act = deviationAt(acts);
  const double settled = kSettlingWays * truck_.rear_axle_to_hinge;
  if (!at_label || !at_act || at_act->way < settled) return;
  const double arm = truck_.front_axle_to_hinge + truck_.rear_axle_to_hinge;
  const double lambda = static_cast<double>(lesson.example.speed) * parameters_.lag;
  const double k_e = arm * lambda / (kReturn * kReturn * kReturn);
  const double k_eta = 3.0 * arm * lambda / (kReturn * kReturn) - truck_.rear_axle_to_hinge * k_e;
  const double k_g = 3.0 * lambda / kReturn - 1.0;
  const double eta = at_act->course - truck_.rear_axle_to_hinge / arm * at_act->articulation;
  const double back = -k_e * at_act->offset - k_eta * eta - k_g * at_act->articulation;
  lesson.correction = static_cast<float>(back - at_label->articulation);
  lesson.offset = static_cast<float>(at_act->offset);
}

void Demonstration::forgetOld() {
  const Stamp oldest = motions_.back().motion.stamp - kMemory - fromSeconds(parameters_.label_after);
  while (motions_.size() > 1 && motions_.front().motion.stamp < oldest) motions_.pop_front();
  while (!deviations_.empty() && deviations_.front().stamp < oldest) deviations_.pop_front();
  while (next_place_ > 0 && places_.front().stamp < oldest) {
    places_.pop_front();
    --next_place_;
  }
}

}  // namespace tunnel_pilot::learning
