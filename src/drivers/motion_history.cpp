#include "tunnel_pilot/drivers/motion_history.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::drivers {

namespace {

constexpr double kLargest = 1e6;  // [m], [rad], [m/s], [rad/s]
// What odometry may err by from one message to the next, beyond what its own speeds say: far more than
// its noise, far less than the room beside a truck in its drift.
constexpr double kPoseError = 0.25;      // [m]
constexpr double kHeadingError = 0.1;    // [rad]
constexpr double kStampError = 0.05;     // [s]
constexpr double kFastest = 15.0;        // [m/s] no truck's speed is higher, whatever is said
constexpr double kFastestTurn = 1.5;     // [rad/s]
constexpr double kLongestSilence = 1.0;  // [s] a truck that moves on for longer is somewhere else

}  // namespace

bool isUsable(const Motion& motion) {
  const std::array<double, 7> numbers = {
      motion.pose.x,   motion.pose.y,       motion.pose.heading,     motion.speed,
      motion.yaw_rate, motion.articulation, motion.articulation_rate};
  // Written so that numbers that are none fail.
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::abs(x) <= kLargest; });
}

bool leadsTo(const Motion& before, const Motion& after) {
  const double time = std::min(toSeconds(after.stamp - before.stamp), kLongestSilence) + kStampError;
  const auto most = [time](double a, double b, double fastest) {
    return std::min(std::max(std::abs(a), std::abs(b)), fastest) * time;
  };
  const double step = (after.pose.position() - before.pose.position()).norm();
  const double turn = std::abs(geometry::wrapAngle(after.pose.heading - before.pose.heading));
  return step <= kPoseError + most(before.speed, after.speed, kFastest) &&
         turn <= kHeadingError + most(before.yaw_rate, after.yaw_rate, kFastestTurn);
}

geometry::Pose advanced(const geometry::Pose& pose, double speed, double yaw_rate, double time) {
  const double turn = yaw_rate * time;
  // The chord of the arc points to its middle heading; 1 - turn^2/24 is its length over the arc's.
  const double chord = speed * time * (1.0 - turn * turn / 24.0);
  return pose.compose({chord * std::cos(0.5 * turn), chord * std::sin(0.5 * turn), turn});
}

bool MotionHistory::add(const Motion& motion, Stamp now) {
  if (!isUsable(motion) || motion.stamp > now + max_ahead_) return false;
  if (size_ > 0 && motion.stamp <= latest().stamp) return false;
  newest_ = (newest_ + 1) % ring_.size();
  ring_[newest_] = motion;
  if (size_ < ring_.size()) ++size_;
  return true;
}

const Motion& MotionHistory::sample(std::size_t age) const {
  return ring_[(newest_ + ring_.size() - age) % ring_.size()];
}

std::optional<geometry::Pose> MotionHistory::poseAt(Stamp stamp) const {
  if (size_ == 0) return std::nullopt;
  std::size_t age = 0;
  while (age < size_ && sample(age).stamp > stamp) ++age;
  if (age == 0 || age == size_) {
    const Motion& end = age == 0 ? latest() : sample(size_ - 1);
    const Stamp beyond = stamp - end.stamp;
    if (beyond > kReach || beyond < -kReach) return std::nullopt;
    return advanced(end.pose, end.speed, end.yaw_rate, toSeconds(beyond));
  }
  const Motion& before = sample(age);
  const Motion& after = sample(age - 1);
  const double t = toSeconds(stamp - before.stamp) / toSeconds(after.stamp - before.stamp);
  const geometry::Pose step = before.pose.relative(after.pose);
  return before.pose.compose({t * step.x, t * step.y, t * step.heading});
}

}  // namespace tunnel_pilot::drivers
