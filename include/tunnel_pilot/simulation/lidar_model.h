#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/world/ray_caster.h"

namespace tunnel_pilot::simulation {

/// Dust takes echoes away. Lost echoes come as +infinity, as a sensor cannot tell them from free space;
/// beams blinded by a cloud come as NaN.
struct DustParameters {
  double dropout_min;         ///< share of beams that dust meets, drawn once per seed from ... [1]
  double dropout_max;         ///< ... this range [1]
  double early_return_share;  ///< of the beams met: those that return from the dust itself [1]
  double burst_rate;          ///< clouds before the sensor [1/s]
  double burst_duration;      ///< mean [s]
  double burst_width;         ///< [rad]
  double burst_dropout;       ///< share of beams blinded inside a cloud [1]
};

struct LidarParameters {
  double rate;             ///< sweeps [Hz]
  double latency;          ///< from the first beam to delivery [s]
  double angle_min;        ///< first beam, left of forward positive [rad]
  double angle_increment;  ///< [rad]
  int beams;
  double range_min;       ///< [m]
  double range_max;       ///< [m]
  double range_sigma;     ///< noise of one range [m]
  double range_bias_max;  ///< a unit's bias is drawn from +- this [m]
  int sectors;            ///< parts of a sweep that are cast from a pose of their own
  DustParameters dust;
};

LidarParameters loadLidar(config::Node node);

/// A rotating planar lidar: exact ranges (world::RayCaster) from a pose that moves during the sweep,
/// plus bias, noise, dust and the shadow the ground throws when the truck pitches. The time between
/// beams is that of a full turn, angle_increment / (2 pi rate). REP-117: beyond range_max +infinity,
/// below range_min -infinity.
class LidarModel {
 public:
  LidarModel(const LidarParameters& parameters, std::uint64_t seed);

  static world::RayCaster::Beams beams(const LidarParameters& parameters);

  /// Duration from the first to the last beam [s].
  double sweepDuration() const;

  /// One sweep whose first beam leaves at `first` (sensor pose in the map) and whose last beam leaves at
  /// `last`; `height` [m] above ground and `pitch` [rad, nose down] tell where the ground hides walls.
  /// The result stays valid until the next call. Allocation-free after the first.
  const geometry::Scan& sweep(const world::RayCaster& caster, const geometry::Pose& first,
                              const geometry::Pose& last, double height, double pitch, Stamp stamp);

  double bias() const { return bias_; }        ///< of this unit [m]
  double dropout() const { return dropout_; }  ///< share of beams that dust meets [1]

 private:
  static constexpr int kErrorBits = 12;

  void cast(const world::RayCaster& caster, const geometry::Pose& first, const geometry::Pose& last);
  void hideBehindGround(double height, double pitch);
  void addNoiseAndDust();
  void addBurst(Stamp stamp);

  LidarParameters parameters_;
  Random noise_;
  Random dust_;
  double bias_;
  double dropout_;
  /// Equally likely errors of this unit's ranges, bias included [m]. Much finer than the millimetre that
  /// such a sensor resolves, and several times faster than a normal number for every beam.
  std::array<float, std::size_t{1} << kErrorBits> errors_;
  double burst_direction_ = 0.0;  ///< [rad]
  Stamp burst_end_;
  geometry::Scan scan_;
};

}  // namespace tunnel_pilot::simulation
