#pragma once

#include <vector>

#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::drivers {

/// The articulation with which the front axle follows a path exactly, by the exact curvature inversion
///   d(gamma)/ds = [kappa (l_f cos(gamma) + l_r) - sin(gamma)] / l_r,
/// integrated along the path from the steady articulation of its first curvature; a wrong start fades
/// with the length constant l_r. (Hinge-velocity matching, Corke & Ridley 2001.)
class ArticulationProfile {
 public:
  struct Sample {
    double s;             ///< [m]
    double curvature;     ///< mean over the step [1/m]
    double articulation;  ///< [rad]
  };

  /// Samples every `spacing` [m] along `path`, reusing memory. An empty path empties the profile.
  void build(const geometry::Path& path, const vehicle::TruckGeometry& truck, double spacing);

  bool empty() const { return samples_.empty(); }
  const std::vector<Sample>& samples() const { return samples_; }

  /// Articulation at arc length `s` [m], clamped to the ends. Must not be called on an empty profile.
  double at(double s) const;
  double curvatureAt(double s) const;  ///< of the sample before `s`, likewise [1/m]

 private:
  double indexOf(double s) const;

  std::vector<Sample> samples_;
  double spacing_ = 1.0;
};

}  // namespace tunnel_pilot::drivers
