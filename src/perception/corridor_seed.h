#pragma once

#include <optional>
#include <vector>

#include "point_grid.h"
#include "tunnel_pilot/perception/wall_segmentation.h"

namespace tunnel_pilot::perception {

/// First guess of the tunnel beside the origin.
struct CorridorSeed {
  double heading = 0.0;         ///< of the tunnel [rad]
  double curvature = 0.0;       ///< of the arc through the origin [1/m]
  std::optional<double> left;   ///< lateral place of the left wall, positive [m]
  std::optional<double> right;  ///< lateral place of the right wall, negative [m]
};

/// Votes of near groups over heading and curvature. Along the arc of curvature k through the origin with
/// heading phi, a point (u, v) in the arc's frame has the lateral offset
///     d = (1 - sqrt((1 - k v)^2 + (k u)^2)) / k = 2 F / (1 + sqrt(1 - 2 k F)),  F = v - k (u^2 + v^2) /
///     2,
/// and returns of a wall along the arc heap up at one d. The arc with the highest two heaps, left and
/// right of the origin, wins.
class CorridorSeeder {
 public:
  explicit CorridorSeeder(const WallSegmentationParameters& parameters);
  /// What the walls may be: beside a bay or a parked vehicle the highest heap is not the wall, so that
  /// along the best arcs through near returns, and through those twice as far, several heaps are told.
  /// The likeliest comes first. The result is this object's and stands until the next call.
  const std::vector<CorridorSeed>& find(const std::vector<PointGroup>& groups);
  /// Walls left and right along the arc through `frame`, from the groups within `length` [m] ahead of
  /// it.
  CorridorSeed findAlong(const std::vector<PointGroup>& groups, const SliceFrame& frame,
                         double curvature, double length);

 private:
  static constexpr int kBins = 64;  // either side
  struct Heap {
    int bin = -1;
    float votes = 0.0F;
  };
  void gatherWithin(const std::vector<PointGroup>& groups, double radius);
  void gatherAlong(const std::vector<PointGroup>& groups, const SliceFrame& frame, double length);
  void gather(float x, float y);
  std::optional<CorridorSeed> bestArc();
  void findWalls(const CorridorSeed& arc);
  void add(const CorridorSeed& seed);
  CorridorSeed judge(float heading, float curvature, float& votes);
  void vote(float heading, float curvature);
  Heap highestHeap(const float* votes, int apart_from = -kBins) const;
  double offsetOf(const Heap& heap, double side) const;

  const WallSegmentationParameters& parameters_;
  float bin_;                 // [m]
  std::vector<float> x_, y_;  // the groups that vote
  std::vector<CorridorSeed> seeds_;
  float left_[kBins + 2]{};
  float right_[kBins + 2]{};
};

}  // namespace tunnel_pilot::perception
