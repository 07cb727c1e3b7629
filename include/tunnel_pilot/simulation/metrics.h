#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tunnel_pilot/geometry/path.h"
#include "tunnel_pilot/geometry/pose.h"
#include "tunnel_pilot/geometry/time.h"

namespace tunnel_pilot::simulation {

/// The truth about one moment of a drive.
struct TrackSample {
  double time = 0.0;                  ///< from the episode's own zero [s]
  geometry::Pose front;               ///< front axle middle and front heading, map
  geometry::Pose rear;                ///< rear axle middle and rear heading, map
  double articulation = 0.0;          ///< [rad]
  double articulation_command = 0.0;  ///< [rad]
  double speed = 0.0;                 ///< [m/s]
  double yaw_rate = 0.0;              ///< [rad/s]
  double lateral_acceleration = 0.0;  ///< [m/s^2]
  double station = 0.0;               ///< along the reference line, grows without wrapping [m]
  double lateral_offset = 0.0;        ///< left of the reference line [m]
  double heading_error = 0.0;         ///< [rad]
  double curvature = 0.0;             ///< of the reference line [1/m]
  double clearance = 0.0;             ///< of either body to a wall or obstacle [m]
};

/// One scan's answer of the perception beside the truth at the scan's stamp. Errors are measured minus
/// true.
struct PerceptionSample {
  Stamp stamp{};
  double station = 0.0;    ///< [m]
  double curvature = 0.0;  ///< true [1/m]
  bool valid = false;
  double offset_error = 0.0;     ///< [m]
  double heading_error = 0.0;    ///< [rad]
  double width_error = 0.0;      ///< [m]
  double curvature_error = 0.0;  ///< [1/m]
};

/// Named figures of one episode, SI units.
using Metrics = std::map<std::string, double>;

/// How a metric is told to people: its name, the unit shown and the factor from SI to it.
struct MetricText {
  std::string key;
  std::string words;
  std::string unit;
  double factor;
};

/// The text of a metric. Throws std::out_of_range for a name that no metric has.
const MetricText& metricText(const std::string& key);
bool isMetric(const std::string& key);

/// Figures of a drive along `line` (a tunnel's design line): lateral_mean, _rms, _max; heading_mean,
/// _rms over all, and heading_rms_straights where the line is straight; articulation_std_straights where
/// it has been straight for 10 m and stays so for 3 m (before that the hinge is still unwinding, by
/// geometry); clearance_min, speed_mean, speed_max_straights, distance; stops, the standstills on the
/// way; and where the line bends, the offsets by side: lateral_mean and _rms with _left_bends and
/// _right_bends, inside_mean (positive: bends are cut). Samples at standstill do not count.
Metrics driveMetrics(const std::vector<TrackSample>& track, const geometry::Path& line);

/// Figures of a return to the centre from (offset, heading): heading_zero_time [s], settle_time (from
/// when on |offset| < 0.1 m), overshoot beyond the centre [m]. An event that did not happen gives
/// infinity.
Metrics returnMetrics(const std::vector<TrackSample>& track);

/// Figures of following a path: path_error_max, path_error_rms [m], lateral_acceleration_max,
/// articulation_max, articulation_rate_max.
Metrics pathMetrics(const std::vector<TrackSample>& track);

/// Figures of a steady turn after `settled` [s]: turn_time (seconds for `angle` [rad]), turn_radius,
/// lateral_acceleration. Throws std::invalid_argument when nothing was recorded after that time.
Metrics steadyTurnMetrics(const std::vector<TrackSample>& track, double settled, double angle);

/// Figures of the perception: valid_share, and of the valid answers the absolute errors' medians and
/// 95th percentiles by radius of bend: tight (8-16 m), gentle (wider than 16 m), straight.
Metrics perceptionMetrics(const std::vector<PerceptionSample>& samples);

/// Quantile `share` in [0, 1] by linear interpolation between order statistics; NaN of nothing.
double quantile(std::vector<double> values, double share);

}  // namespace tunnel_pilot::simulation
