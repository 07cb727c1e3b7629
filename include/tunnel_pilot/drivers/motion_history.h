#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include "tunnel_pilot/drivers/driver.h"

namespace tunnel_pilot::drivers {

/// The last seconds of the truck's own motion, to bring what a scan measured to the present.
class MotionHistory {
 public:
  static constexpr Stamp kReach = std::chrono::milliseconds(300);
  static constexpr Stamp kMaxAhead = std::chrono::milliseconds(50);

  explicit MotionHistory(Stamp max_ahead = kMaxAhead) : max_ahead_(max_ahead) {}

  /// Takes a motion newer than the last one. False: it is older, not usable, or farther ahead of `now`
  /// than `max_ahead`, and is left out; one from the future would keep out all that come after it.
  /// Allocation-free.
  bool add(const Motion& motion, Stamp now);
  void clear() { size_ = 0; }
  void keepLatest() { size_ = std::min<std::size_t>(size_, 1); }  ///< forgets all before it

  bool empty() const { return size_ == 0; }
  const Motion& latest() const { return ring_[newest_]; }

  /// base_link in odom at `stamp`: interpolated between samples; up to kReach beyond the ends it is
  /// extrapolated with the end's speed and yaw rate. None farther away or without any motion.
  std::optional<geometry::Pose> poseAt(Stamp stamp) const;

 private:
  const Motion& sample(std::size_t age) const;  ///< 0: the newest

  Stamp max_ahead_;
  std::array<Motion, 64> ring_{};
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

/// `pose` moved on for `time` [s] (negative: back) with constant speed and yaw rate.
geometry::Pose advanced(const geometry::Pose& pose, double speed, double yaw_rate, double time);

/// True when every number is one, and of a magnitude of at most 1e6: a pose farther away than 1000 km
/// resolves no nanometre any more, and squares of the largest numbers are none.
bool isUsable(const Motion& motion);

/// A truck can have come from the one pose to the other in the time between. If not, odometry was set
/// anew or one of the two is false: what is known in the frame of the first means nothing in the
/// second's.
bool leadsTo(const Motion& before, const Motion& after);

}  // namespace tunnel_pilot::drivers
