#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "tunnel_pilot/drivers/driver.h"

namespace tunnel_pilot::drivers {

/// The last seconds of the truck's own motion, to bring what a scan measured to the present.
class MotionHistory {
 public:
  /// Takes a motion newer than the last one; an older or non-finite one is ignored. Allocation-free.
  void add(const Motion& motion);
  void clear() { size_ = 0; }

  bool empty() const { return size_ == 0; }
  const Motion& latest() const { return ring_[newest_]; }

  /// base_link in odom at `stamp`: interpolated between samples; up to kReach beyond the ends it is
  /// extrapolated with the end's speed and yaw rate. None farther away or without any motion.
  std::optional<geometry::Pose> poseAt(Stamp stamp) const;

  static constexpr Stamp kReach = std::chrono::milliseconds(300);

 private:
  const Motion& sample(std::size_t age) const;  ///< 0: the newest

  std::array<Motion, 64> ring_{};
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

/// `pose` moved on for `time` [s] (negative: back) with constant speed and yaw rate.
geometry::Pose advanced(const geometry::Pose& pose, double speed, double yaw_rate, double time);

/// True when every number is finite.
bool isFinite(const Motion& motion);

}  // namespace tunnel_pilot::drivers
