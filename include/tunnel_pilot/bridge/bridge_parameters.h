#pragma once

#include <string>
#include <vector>

#include "tunnel_pilot/bridge/odometry.h"
#include "tunnel_pilot/bridge/odometry_error.h"
#include "tunnel_pilot/can/profile.h"
#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::bridge {

/// How the steering answers its command: what the tracking watch expects and tolerates.
struct TrackingParameters {
  double dead_time;  ///< [s]
  double lag;        ///< first order [s]
  double max_rate;   ///< fastest the hydraulics may move [rad/s]
  double min_rate;   ///< slowest they may move (engine at idle) [rad/s]
  double max_error;  ///< outside of what both rates expect [rad]
  double max_time;   ///< that the error may last [s]
};

/// All values of config/can_bridge.yaml (limits: RELIABILITY rows C3-C8, A1-A6).
struct BridgeParameters {
  double frame_period;              ///< of the command frames [s]
  double command_timeout;           ///< since the last command was received [s]
  double measurement_late;          ///< age of the command's measurement that degrades [s]
  double measurement_timeout;       ///< age that stops [s]
  double future_tolerance;          ///< a measurement may lie ahead of now [s]
  double feedback_timeout;          ///< of each of the truck's three frames [s]
  double health_time;               ///< inputs healthy before engaging, resetting, recovering [s]
  double arming_time;               ///< of frames "not intended to steer" before the first that is [s]
  double arming_timeout;            ///< to wait for a command to drive [s]
  double obedience_timeout;         ///< for the truck to tell that it obeys [s]
  double standstill_speed;          ///< [m/s]
  double standstill_time;           ///< below it before STOPPED [s]
  double stopping_timeout;          ///< longer than any stop takes [s]
  double max_speed;                 ///< a command above is refused [m/s]
  double max_acceleration;          ///< a command above is refused [m/s^2]
  double degraded_speed;            ///< [m/s]
  double stop_deceleration;         ///< wanted in STOPPING [m/s^2]
  double steering_rate;             ///< of the angle sent, the last limit before the bus [rad/s]
  double max_lateral_acceleration;  ///< of the angle sent, at the speed measured [m/s^2]
  double gyro_bias_time;            ///< time constant of the gyro's bias at standstill [s]
  double heartbeat_timeout;         ///< of each process in `heartbeats` [s]
  std::vector<std::string> heartbeats;  ///< processes (node names) that must give signs of life
  TrackingParameters tracking;
  SlipModel slip;       ///< for odometry
  SensorErrors errors;  ///< of what odometry is made from
  can::Profile can;     ///< of its bus, for whoever makes that
};

/// Throws config::ConfigError naming file, key, unit and range.
BridgeParameters loadBridge(config::Node node);

}  // namespace tunnel_pilot::bridge
