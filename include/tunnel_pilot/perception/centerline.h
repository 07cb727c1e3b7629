#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/perception/types.h"

namespace tunnel_pilot::perception {

class ArcLengthFit;

struct CenterlineParameters {
  double width_min = 0.0;            ///< narrower is no tunnel [m]
  double width_max = 0.0;            ///< wider is no tunnel [m]
  double length_min = 0.0;           ///< a centerline measured over less is none [m]
  double residual_max = 0.0;         ///< walls that fit worse are none [m]
  double pair_length_min = 0.0;      ///< walls seen beside each other over less are no pair [m]
  double single_distance_max = 0.0;  ///< one wall is followed so far after both were seen [m]
  double single_time_max = 0.0;      ///< or, where there is no odometry, so long [s]
  double width_jump_max = 0.0;     ///< larger changes of width that were not seen coming are faults [m]
  int jump_scans = 0;              ///< a width that lasts this many scans is believed again [1]
  double memory_weight_max = 0.0;  ///< past scans count at most as much as this many [1]
  double memory_behind = 0.0;      ///< past centerline kept behind the reference point [m]
  double memory_error_max = 0.0;   ///< a centerline farther off than this does not fit the past ones [m]
  int disbelief_scans = 0;         ///< as many scans that do not fit in a row: the past is forgotten [1]
  double far_distance = 0.0;       ///< measured centerline counts half at about this distance ahead [m]
  double fit_reach = 0.0;          ///< heading and curvature are fitted over +- this length [m]
  double wall_deviation = 0.0;     ///< smallest deviation of a wall from its curve [m]
  double wall_correlation = 0.0;   ///< correlation length of that deviation [m]
};

/// Throws config::ConfigError.
CenterlineParameters loadCenterline(config::Node node);

/// Makes the tunnel's state and centerline of two walls, and of one for a while.
///
/// Pairs of curve samples give the centerline's points and the width; where one wall is missing the
/// other is followed at the last width. With odometry the centerline is kept as a chain of nodes in the
/// odom frame, each averaged over the scans that saw it (so the reference point, which lies behind what
/// the lidar sees, gets what was measured there before); without odometry each scan stands for itself,
/// and the centerline is prolonged backwards at constant curvature. Heading and curvature are those of a
/// least-squares parabola over arc length,  p(t) = a + b t + c t^2  within +- fit_reach:
///     heading = atan2(b_y, b_x),  curvature = (b x 2 c) / |b|^3,
/// and the covariance is the fit's, sigma^2 (A'A)^-1, times the number of samples within two correlation
/// lengths of the walls' roughness, whose errors are not independent.
class CenterlineEstimator {
 public:
  explicit CenterlineEstimator(const CenterlineParameters& parameters);
  ~CenterlineEstimator();
  CenterlineEstimator(const CenterlineEstimator&) = delete;
  CenterlineEstimator& operator=(const CenterlineEstimator&) = delete;

  /// `odom_pose` is base_link in a smooth frame (dead reckoning) at the walls' stamp; nothing when there
  /// is no odometry. A pose that is not finite, or beyond 1e6 m or rad, counts as none. The result is
  /// this object's and stands until the next call.
  const Tunnel& update(const Walls& walls, const std::optional<geometry::Pose>& odom_pose);

  /// Forgets everything measured (after a clock jump or when odometry starts anew).
  void reset();

 private:
  // A place on the centerline.
  struct Node {
    geometry::Point position = geometry::Point::Zero();  // [m]
    double width = 0.0;                                  // [m]
    double weight = 0.0;                                 // in scans
  };

  enum class Fit { kGood, kBad, kApart };

  // Nodes first..last.
  struct Window {
    std::size_t first;
    std::size_t last;
  };

  // Where a remembered node has one of its walls.
  struct RecalledWall {
    geometry::Point place;   // [m]
    geometry::Point normal;  // to the left
    double width;            // [m]
  };

  const Tunnel& refuse(TunnelReason reason);
  TunnelReason measure(const Walls& walls, const std::optional<geometry::Pose>& pose);
  void followWall(const std::vector<geometry::Point>& curve, double side,
                  const std::optional<geometry::Pose>& pose);
  void recallWall(double side, const geometry::Pose& pose);
  void travel(const Walls& walls, const std::optional<geometry::Pose>& pose);
  TunnelReason checkSingle(const Walls& walls, bool has_odometry) const;
  TunnelReason checkWidth(const std::optional<geometry::Pose>& pose);
  void remember(const geometry::Pose& pose);
  Fit fuse();
  void disbelieve();
  void appendMeasured();
  void forgetBehind(const geometry::Pose& pose);
  Window slide(Window window, std::size_t i) const;
  Window widened(Window window) const;
  void fitPath();
  bool isPlausible();
  void prolongBackwards();
  bool isTunnels(double width) const;
  std::size_t nodeBeside() const;
  void fillState(const Walls& walls);
  void fillCovariance(const Walls& walls, std::size_t at);

  CenterlineParameters parameters_;
  Tunnel tunnel_;
  std::vector<Node> measured_;  // this scan's, in base_link
  std::vector<Node> memory_;    // in the odom frame
  std::vector<Node> before_;    // the memory before this scan
  std::vector<RecalledWall> recalled_;
  std::vector<Node> nodes_;  // what the path is made of, in base_link
  std::vector<geometry::PathPoint> path_;
  std::unique_ptr<ArcLengthFit> fit_;

  bool paired_now_ = false;
  std::optional<double> last_width_;  // beside the truck, once both walls were seen [m]
  std::optional<geometry::Pose> last_pose_;
  std::optional<Stamp> paired_stamp_;
  double single_distance_ = 0.0;  // travelled since both walls were seen [m]
  int jumps_ = 0;
  int doubts_ = 0;  // scans in a row that did not fit
};

}  // namespace tunnel_pilot::perception
