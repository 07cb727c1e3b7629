#pragma once

#include <memory>
#include <vector>

#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::world {

/// Exact ranges from a planar sensor to walls and obstacle outlines (no grid): within 2 mm of the
/// intersections computed in double. Beam i points to angle_min + i * angle_increment in the sensor's
/// frame. Chains that share a vertex let no beam through between them. Casting from several threads at
/// once is safe; setMovingChains() beside it is not. Throws std::invalid_argument for beams that span
/// more than a full turn, more than 16384 beams, beams outside the scan, and what is not finite.
///
/// A segment from p to p + e meets the beam of direction d at range r = (p x e) / (d x e); so 1/r is
/// linear in d, and the nearest of many segments has the greatest 1/r.
class RayCaster {
 public:
  struct Beams {
    double angle_min;        ///< [rad]
    double angle_increment;  ///< [rad], positive
    int count;
    double range_max;  ///< [m]
  };

  RayCaster(const std::vector<WallChain>& walls, const Beams& beams);
  ~RayCaster();
  RayCaster(RayCaster&&) noexcept;
  RayCaster& operator=(RayCaster&&) noexcept;

  /// Replaces the moving chains that are seen beside the walls.
  void setMovingChains(const std::vector<WallChain>& chains);

  /// Writes ranges [first, last) of a scan taken from `sensor`; +infinity where nothing lies within
  /// range_max. `ranges` has room for beams.count values. Allocation-free.
  void cast(const geometry::Pose& sensor, float* ranges, int first, int last) const;
  void cast(const geometry::Pose& sensor, std::vector<float>& ranges) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Smallest distance from any of the polygon's edges to any wall or chain [m]; 0 when they cross.
double clearance(const std::vector<geometry::Point>& polygon, const std::vector<WallChain>& walls);

}  // namespace tunnel_pilot::world
