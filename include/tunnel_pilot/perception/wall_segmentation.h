#pragma once

#include <pcl/pcl_base.h>
#include <pcl/point_types.h>

#include <memory>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/perception/types.h"

namespace tunnel_pilot::perception {

struct WallSegmentationParameters {
  double width_min = 0.0;           ///< narrowest tunnel to expect [m]
  double width_max = 0.0;           ///< widest tunnel to expect [m]
  double lookahead = 0.0;           ///< how far ahead walls are followed, along the tunnel [m]
  double look_behind = 0.0;         ///< curves begin this far behind the cloud's origin [m]
  double step = 0.0;                ///< length of a slice across the tunnel [m]
  double spacing = 0.0;             ///< of returns nearer to each other one counts for all [m]
  double seed_radius = 0.0;         ///< the first guess looks at returns within this distance [m]
  double seed_heading_max = 0.0;    ///< largest heading error of the first guess [rad]
  double seed_curvature_max = 0.0;  ///< largest curvature of the first guess [1/m]
  double wall_deviation = 0.0;      ///< deviation of one slice's wall from a smooth curve [m]
  double curvature_walk = 0.0;      ///< growth of curvature's deviation with distance [1/m per sqrt(m)]
  double width_walk = 0.0;        ///< growth of the half width's deviation with distance [m per sqrt(m)]
  double gate_min = 0.0;          ///< a return this near to the expected wall is always looked at [m]
  double gate_max = 0.0;          ///< and one farther than this never [m]
  double width_change_min = 0.0;  ///< both walls moved alike by so much: the width changes [m]
  double gap_max = 0.0;           ///< tunnel without either wall beyond which it is not followed [m]
  double wall_length_min = 0.0;   ///< a shorter wall is none [m]
  double wall_coverage_min = 0.0;  ///< share of the slices along a wall that must show it [1]
  double inlier_distance = 0.0;    ///< returns nearer to the curve than this are on the wall [m]
  int points_min = 0;              ///< fewer usable returns are too few [1]
};

/// Throws config::ConfigError.
WallSegmentationParameters loadWallSegmentation(config::Node node);

/// Finds the two walls of a tunnel in one planar scan, as a PCL algorithm: setInputCloud, setIndices,
/// then segment(). The cloud's frame has the truck's reference point as origin, x ahead, y left, both
/// walls' near ends beside or ahead of it; its points are best given in beam order (then one of near
/// neighbours stands for all), but need not be.
///
/// Both walls are taken as offset curves of one centerline. Along its arc length s the state
///     (e lateral offset, psi heading, kappa curvature, h half width)
/// of the centerline obeys  e' = psi, psi' = kappa, kappa' and h' white noise, and each slice of the
/// tunnel measures the left wall at e + h and the right wall at e - h. An extended Kalman filter runs
/// from the truck away along the tunnel, takes only returns near the wall it expects (so that side bays,
/// openings, people and parked vehicles fall out) and a Rauch-Tung-Striebel pass runs back, so that each
/// place is fitted to what lies before and behind it. Curves may turn by any angle. The first guess is a
/// vote of the near returns over (heading, curvature), with the offsets of both walls as the peaks of a
/// histogram.
///
/// Sources: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic
/// systems", AIAA Journal 3(8), 1965; E. D. Dickmanns, B. D. Mysliwetz, "Recursive 3-D road and relative
/// ego-state recognition", IEEE PAMI 14(2), 1992 (clothoid road model); P. V. C. Hough, US patent
/// 3,069,654 (the vote).
class WallSegmentation : public pcl::PCLBase<pcl::PointXYZ> {
 public:
  explicit WallSegmentation(const WallSegmentationParameters& parameters);
  ~WallSegmentation() override;
  WallSegmentation(const WallSegmentation&) = delete;
  WallSegmentation& operator=(const WallSegmentation&) = delete;

  /// The walls of the input cloud. `stamp` is copied. Indices are those of the input cloud, ascending.
  /// The result is this object's and stands until the next call. Points that are not finite are ignored.
  const Walls& segment(Stamp stamp);

  /// Forgets the last scan, whose tunnel is the first guess for the next one (after a clock jump).
  void reset();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  WallSegmentationParameters parameters_;
  Walls walls_;
};

}  // namespace tunnel_pilot::perception
