#pragma once

#include <ros/node_handle.h>
#include <tunnel_pilot/ArbiterState.h>
#include <tunnel_pilot/SimulatorTruth.h>
#include <tunnel_pilot/TruckStatus.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/simulation/metrics.h"

namespace tunnel_pilot::shell {

struct LapMonitorParameters {
  double lateral_rms_max;  ///< [m]
  double lateral_max_max;  ///< [m]
  double ready_timeout;    ///< until the bridge must let itself be engaged, steady time [s]
  double stall_timeout;    ///< without a message from the simulator, steady time [s]
  double lap_time_max;     ///< simulated time [s]
};

/// Throws config::ConfigError.
LapMonitorParameters loadLapMonitor(config::Node node);

/// The demonstration's operator and judge. Calls `engage` until the bridge agrees, watches the
/// simulator's truth for one lap, prints a progress line every two seconds, and ends the process'
/// spinning with one line, PASS {json} or FAIL {json}: lap_time_s, lateral_mean_m,
/// lateral_rms_m, lateral_max_m, heading_mean_deg, clearance_min_m, contacts, real_time_factor and,
/// after a failure, reason. It passes with one whole lap, no contact and the lateral goals kept.
/// Subscribes `truth`, `truck_status`, `arbiter_state`. Parameters: config/lap_monitor.yaml and
/// `verdict_file`, which gets that line (-, or what cannot be written: standard output). Throws
/// config::ConfigError.
class LapMonitor {
 public:
  LapMonitor(ros::NodeHandle nh, ros::NodeHandle private_nh);

  /// The verdict, once there is one.
  std::optional<bool> passed() const { return passed_; }

  /// The verdict as it was printed; empty until there is one.
  const std::string& verdict() const { return verdict_; }

  /// Figures of the drive so far (simulation::driveMetrics) and its lap_time [s].
  simulation::Metrics metrics() const;

 private:
  void onTruth(const SimulatorTruth& message);
  void onTruckStatus(const TruckStatus& message);
  void onArbiterState(const ArbiterState& message) { reason_ = message.reason_text; }
  void onTimer(const ros::WallTimerEvent& event);
  void engage();
  void checkLap(const SimulatorTruth& message);
  void printProgress() const;
  void finish(const std::string& failure);

  LapMonitorParameters parameters_;
  std::string verdict_file_;
  ros::ServiceClient engage_client_;
  ros::Subscriber truth_subscriber_, status_subscriber_, arbiter_subscriber_;
  ros::WallTimer timer_;

  bool engaged_ = false;
  std::string refusal_ = "the bridge's service 'engage' is not there";
  std::string reason_;  // the arbiter's, in words
  ros::SteadyTime started_, engaged_at_, heard_;
  int ticks_ = 0;
  ros::Time lap_begin_;
  std::optional<SimulatorTruth> first_, last_;
  std::vector<simulation::TrackSample> track_;
  std::optional<bool> passed_;
  std::string verdict_;
};

}  // namespace tunnel_pilot::shell
