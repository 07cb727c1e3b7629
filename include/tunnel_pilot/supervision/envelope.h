#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/drivers/articulation_profile.h"
#include "tunnel_pilot/drivers/path_follower.h"
#include "tunnel_pilot/drivers/path_model.h"
#include "tunnel_pilot/perception/types.h"
#include "tunnel_pilot/supervision/command_limiter.h"
#include "tunnel_pilot/vehicle/truck_parameters.h"

namespace tunnel_pilot::supervision {

struct EnvelopeParameters {
  double margin;             ///< least distance between swept bodies and walls or obstacles [m]
  double smallest_obstacle;  ///< [m]
  int obstacle_points;       ///< returns, one beside the other, that make an obstacle
  double deceleration;       ///< a stop's, guaranteed [m/s^2]
  double reaction_time;      ///< from measurement to braking [s]
  double reserve;            ///< between the nose and an obstacle after a stop [m]
  double horizon;            ///< longest corridor ahead of the front axle [m]
  drivers::PathFollowerGains follower;  ///< how the expected way returns to the centerline
};

/// Reads and checks the envelope's part of config/arbiter.yaml. Throws config::ConfigError.
EnvelopeParameters loadEnvelope(config::Node node);

/// The corridor that both bodies will sweep, against the walls and returns of one scan.
/// The truck is driven ahead on paper: for the reaction time with the articulation commanded now, then
/// back to the measured centerline (PathFollower), within the steering's rate at the speed of a stop;
/// without a centerline the commanded articulation is held. It turns as its yaw rate was measured to
/// answer, and crabs by the front axle's slip angle (beta of PreviewPlanner). Outline points of both
/// bodies (nose, axles, hinge, tail, both sides) draw lines beside the front axle's way, the spine,
/// which goes on backwards through the truck to its tail: each metre of it has a left and a right edge.
/// Walls, remembered walls and returns are laid beside the same spine and compared. Free space is only
/// what was seen: it ends with the centerline, or else with the walls. Everything is in base_link of the
/// scan. Allocation-free once its buffers have grown.
class Envelope {
 public:
  struct Input {
    const perception::Walls& walls;
    const std::vector<geometry::Point>& points;  ///< returns in scan order [m]
    const geometry::Path& centerline;
    const drivers::ArticulationProfile& profile;  ///< of the centerline; empty where there is none
    geometry::Pose path_frame;                    ///< the centerline's frame, in base_link of the scan
    geometry::Pose truck;                         ///< base_link now, in base_link of the scan
    geometry::Pose scan_pose;                     ///< base_link of the scan, in odom
    double articulation;                          ///< [rad]
    double commanded_articulation;                ///< [rad]
    double speed;                                 ///< [m/s]
    drivers::YawResponse response{};              ///< of the truck, as measured
    double slip_compliance = 0.0;  ///< tyre slip angle per lateral acceleration [rad s^2/m]
  };
  enum class End { kSight, kWall, kObstacle };
  struct Result {
    double clearance_left = 0.0;  ///< smallest distance of the swept bodies to the wall [m], NaN unknown
    double clearance_right = 0.0;
    double free_distance = 0.0;  ///< ahead of the nose along the corridor [m]
    End free_until = End::kSight;
    std::vector<geometry::Point> corridor_left;  ///< edges, tail to front [m]
    std::vector<geometry::Point> corridor_right;
  };

  Envelope(const EnvelopeParameters& parameters, const CommandLimiterParameters& limits,
           const vehicle::TruckGeometry& geometry);

  const Result& update(const Input& input);
  const Result& result() const { return result_; }

  /// Way to standstill, from the measurement on: v t_r + v^2 / (2 b) [m].
  double stoppingDistance(double speed) const;

  void reset();  ///< forgets the walls passed

  void setMargin(double margin) { parameters_.margin = margin; }  ///< from the next update on [m]

 private:
  struct Station {
    geometry::Point point;         ///< on the spine
    geometry::Point direction;     ///< unit, forward
    double s;                      ///< from the front axle, forward [m]
    double left, right;            ///< corridor's edges beside it, -inf/+inf where nothing passes [m]
    double wall_left, wall_right;  ///< nearest wall, +inf/-inf where none is known [m]
  };
  struct Beside {
    std::size_t station;
    double s, lateral;
  };
  struct Posture {
    geometry::Frame front;
    double articulation;
  };
  struct OutlinePoint {
    double along;           ///< its own body's axle, forward [m]
    double stations_ahead;  ///< of the front axle's station, truck straight
  };
  struct Remembered {
    geometry::Point point;  ///< odom
    bool left;
  };

  void layTruck(const Input& input);
  void layWay(const Input& input);
  double brakedSpeed(double speed, double braking) const;
  double slipAngle(const Input& input, double speed, double articulation, double curvature) const;
  void sweepBodies(std::size_t station, const Posture& posture, bool first);
  void layWall(const Input& input, bool left);
  void remember(const Input& input);
  void compareWalls();
  void findObstacles(const std::vector<geometry::Point>& points);
  void limitSight(const Input& input);
  bool inCorridor(const Beside& place) const;
  bool onWall(const Beside& place) const;
  void drawCorridor();
  template <typename Take>
  void between(const Beside& a, const Beside& b, const Take& take);
  void layEdge(const Beside& a, const Beside& b, bool left);
  void layWallPiece(const Beside& a, const Beside& b, bool left);
  void endFreeSpace(double s, End why);
  Beside beside(const geometry::Point& point, std::size_t near) const;
  void addStation(const geometry::Point& point, const geometry::Point& direction, double s);

  EnvelopeParameters parameters_;
  CommandLimiterParameters limits_;
  vehicle::TruckGeometry geometry_;
  Result result_;
  std::vector<Station> stations_;
  static constexpr std::size_t kFrontOutline = 3;  ///< nose, front axle, hinge
  static constexpr std::size_t kOutline = 7;       ///< hinge, middle, rear axle, tail
  std::array<OutlinePoint, kOutline> outline_{};
  std::array<Beside, 2 * kOutline> swept_{};  ///< the last posture's outline, left side first
  std::vector<Posture> postures_;             ///< along the way ahead
  std::size_t front_axle_ = 0;                ///< station of the front axle now
  double wall_end_ = 0.0;                     ///< farthest station with a wall [m]
  double path_ahead_ = 0.0;                   ///< of the centerline, from the front axle on [m]
  std::array<Remembered, 64> memory_{};
  std::size_t remembered_ = 0;  ///< number ever remembered
  geometry::Point last_remembered_at_{0.0, 0.0};
};

}  // namespace tunnel_pilot::supervision
