#pragma once

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/geometry/scan.h"
#include "tunnel_pilot/perception/isolated_return_filter.h"

namespace tunnel_pilot::perception {

struct ScanFilterParameters {
  double range_min = 0.0;           ///< nearer returns are none [m]; the scan's own limit counts too
  double range_max = 0.0;           ///< farther returns are none [m]; the scan's own limit counts too
  bool check_age = true;            ///< false for replayed recordings
  double max_future = 0.0;          ///< a stamp farther ahead of now is refused [s]
  double max_age = 0.0;             ///< an older stamp is refused [s]
  int frozen_count = 0;             ///< this many identical range arrays in a row: frozen [1]
  int isolation_window = 0;         ///< beams looked at on either side of a return [1]
  int isolation_min_neighbors = 0;  ///< returns with fewer neighbours near them are dust [1]
  double isolation_distance = 0.0;  ///< what near means, at range 0 [m]
  double isolation_slope = 0.0;     ///< and how it grows with the range [1]
  double gap_max = 0.0;             ///< widest gap filled in the network's scan [rad]
};

/// Throws config::ConfigError.
ScanFilterParameters loadScanFilter(config::Node node);

/// Checks a scan of any lidar that covers +-90 degrees of the truck's front, and turns it into what the
/// later stages read. Meanings are REP-117's. Nothing that is wrong with a scan throws: it is rejected,
/// with the reason, and counted.
///
/// A usable return is finite and within both the scan's and the parameters' range limits; whatever code
/// a sensor sends for "no echo" (8.19 m, 81.9 m, 0.002 m) lies outside and is dropped.
class ScanFilter {
 public:
  enum class Rejection : std::uint8_t {
    kNone = 0,             ///< accepted
    kMalformed = 1,        ///< angles beyond a turn, range limits that are none, or a pose not finite
    kWrongSize = 2,        ///< number of ranges does not suit the announced angles
    kFieldOfView = 3,      ///< does not cover +-90 degrees of base_link
    kGeometryChanged = 4,  ///< other angles, size or limits than the first accepted scan's
    kAllNan = 5,
    kAllInfinite = 6,
    kNegative = 7,   ///< some range is finite and negative
    kNoReturns = 8,  ///< no range within the limits
    kFuture = 9,
    kTooOld = 10,
    kRepeated = 11,  ///< the last accepted stamp again
    kBackward = 12,  ///< a stamp before the last accepted one
    kFrozen = 13,    ///< the same ranges again and again
  };
  static constexpr std::size_t kRejections = 14;

  /// The network's scan: beams at -95, -94.75, ... 95 degrees of base_link.
  static constexpr int kNetworkBeams = 761;

  struct Result {
    bool accepted = false;
    Rejection rejection = Rejection::kNone;
    /// 761 ranges in the sensor's frame, beam 380 straight ahead of base_link. Small gaps are filled
    /// between their edges; larger ones keep NaN or +infinity, and so do beams outside the sensor's view
    /// (NaN). Empty when rejected.
    geometry::Scan network_scan;
    /// Usable returns without the isolated ones, in beam order, in base_link (z = 0); sensor_origin_ is
    /// the lidar. Never null, empty when rejected.
    pcl::PointCloud<pcl::PointXYZ>::Ptr points;
    /// Share of beams with a usable, not isolated return [1]: left (30..90 degrees), front (-30..30),
    /// right (-90..-30).
    std::array<double, 3> valid_fraction{};
  };

  explicit ScanFilter(const ScanFilterParameters& parameters);

  /// `sensor_in_base` is the lidar's pose in base_link. The result is this object's and stands until the
  /// next call; its points are a new cloud whenever somebody still holds the last one.
  const Result& filter(const geometry::Scan& scan, const geometry::Pose& sensor_in_base, Stamp now);

  /// Forgets the announced geometry and the last stamp (after a clock jump). Counters stay, and so do
  /// the last ranges: a sensor that is frozen stays so.
  void reset();

  std::uint64_t accepted() const { return counts_[0]; }
  std::uint64_t rejected() const;
  std::uint64_t count(Rejection rejection) const { return counts_[static_cast<std::size_t>(rejection)]; }

 private:
  // What a network beam is made from: source beams `first` and `first + 1` and the way between them.
  struct Source {
    int first;  // -1: outside the view
    float fraction;
  };

  Rejection check(const geometry::Scan& scan, const geometry::Pose& sensor, Stamp now);
  Rejection checkGeometry(const geometry::Scan& scan, const geometry::Pose& sensor) const;
  Rejection checkStamp(Stamp stamp, Stamp now) const;
  Rejection checkRanges(const geometry::Scan& scan);
  void adopt(const geometry::Scan& scan, const geometry::Pose& sensor);
  void adoptSources(double angle_min, double angle_increment, int size);
  void makeCloud(const geometry::Scan& scan);
  void gatherPoints();
  void measureSectors(const geometry::Scan& scan);
  void makeNetworkScan(const geometry::Scan& scan);
  void resample(std::vector<float>& ranges) const;
  void fillGaps(std::vector<float>& ranges) const;

  ScanFilterParameters parameters_;
  IsolatedReturnFilter<pcl::PointXYZ> isolated_;
  Result result_;
  std::array<std::uint64_t, kRejections> counts_{};

  // The announced geometry and what follows from it.
  bool announced_ = false;
  geometry::Scan model_;  // of the first accepted scan; its ranges are the last scan's
  geometry::Pose sensor_;
  std::vector<float> cosines_, sines_;  // of the beams, in base_link
  std::vector<std::uint8_t> sectors_;   // 0 left, 1 front, 2 right, 3 none
  std::array<int, 3> sector_sizes_{};
  std::vector<Source> sources_;
  bool same_beams_ = false;  // the scan's beams are the network's

  std::optional<Stamp> last_stamp_;
  std::vector<float> last_ranges_;
  int identical_ = 0;

  pcl::PointCloud<pcl::PointXYZ>::Ptr beams_;  // one point a beam, NaN where there is no return
  std::vector<int> kept_;                      // beams whose return stays
  std::vector<float> clean_;                   // ranges with NaN for what was dropped
};

/// The reason in words an operator understands.
std::string toString(ScanFilter::Rejection rejection);

}  // namespace tunnel_pilot::perception
