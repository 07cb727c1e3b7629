#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tunnel_pilot/TruckCommand.h>

#include <memory>
#include <string>

#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/ros/bus_tap.h"
#include "tunnel_pilot/ros/diagnostics.h"
#include "tunnel_pilot/simulation/simulator.h"

namespace tunnel_pilot::shell {

/// Holds simulated time back to `factor` times steady time. It never hurries to make up for time lost.
class Pace {
 public:
  /// Sleeps as long as `now` is early. Factor 0: never.
  void hold(Stamp now, double factor);

 private:
  double factor_ = -1.0;
  Stamp simulated_start_{};
  ros::SteadyTime steady_start_;
};

/// Shell of simulation::Simulator, stage-like: owns /clock, fixed step, one seed. The pilot gets CAN
/// frames over the embedded bus and `scan` (frame `laser`, stamped at its first beam, published after
/// the lidar's latency), and gives frames back; nothing else passes between them. For people and judges,
/// on topics of its own: `~truth` (tunnel_pilot/SimulatorTruth), `~walls` and
/// `~obstacles` (visualization_msgs/MarkerArray in map, latched), TF map -> odom (from `odom` and the
/// truth, as a localisation would). Services ~reset (std_srvs/Trigger: the truck back to its start, at
/// rest; time goes on) and ~pause (std_srvs/SetBool: time stands still). Contacts of either body are
/// logged and counted.
///
/// Lockstep: time stands still after each scan until `command` carries the scan's stamp, and at each
/// 20 ms until the bridge has sent its frame, however long that takes; where that frame stems from an
/// older scan than the command of 20 ms ago, the next 20 ms take as long. So what the pilot judges by
/// its age does not depend on how busy the machine is. Who leaves, or is silent for kLongestSilence, is
/// given up, which is logged and told on /diagnostics. While pilot or bridge is given up, has not
/// answered yet, or no driver steers, it is not waited for and time runs no faster than real time; its
/// next answer brings the lockstep back. `real_time_factor` holds the lockstep back; 0 runs as fast as
/// the pilot answers.
///
/// Parameters: config/simulator.yaml, and `truck_file`, `truck_controller_file`, `world_file` (paths),
/// `bus` (name of the embedded bus), `profile` (of the bus, may be left out: then truck_controller_file
/// says it), `load` (empty, loaded), `seed`, `reversed` (true: the other way
/// round), `real_time_factor`. Throws config::ConfigError.
class SimulatorRos {
 public:
  SimulatorRos(ros::NodeHandle nh, ros::NodeHandle private_nh);

  /// Advances by one step, publishes what it brought, waits as told above. Call it again and again.
  void advance();

 private:
  static constexpr double kLongestSilence = 3.0;  // [s] steady time

  // One whose answers time waits for.
  struct Partner {
    const char* name;
    bool alive = false;  // answered lately
    unsigned long given_up = 0;
  };

  void configure(const ros::NodeHandle& private_nh);
  void advertise(ros::NodeHandle& nh, ros::NodeHandle& private_nh);
  void publishClock();
  void publishScan(const geometry::Scan& scan);
  void publishTruth();
  void publishWalls();
  void publishObstacles();
  void onCommand(const TruckCommand& message);
  void onOdometry(const nav_msgs::Odometry& message);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onPause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  template <class Answered>
  void await(Partner& partner, const ros::Subscriber& topic, Answered answered);
  void awaitCommand(Stamp stamp);
  void awaitBridge();
  bool inLockstep() const { return pilot_.alive && bridge_.alive; }
  void fillStatus(Diagnostics::Status& status);

  ros::CallbackQueue queue_;
  std::unique_ptr<BusTap> bus_;
  std::unique_ptr<simulation::Simulator> simulator_;
  double scan_period_ = 0.0;  // [s]
  double real_time_factor_ = 1.0;
  bool paused_ = false;
  Pace pace_;
  Partner pilot_{"pilot"}, bridge_{"bridge"};
  Stamp command_stamp_{};            // of the newest `command`
  Stamp driver_stamp_{};             // of the newest that a driver steers
  Stamp expected_stamp_{};           // that the bridge's next frame must know
  std::uint64_t bridge_frames_ = 0;  // at the last wait
  unsigned long late_commands_ = 0;
  drivers::MotionHistory true_motion_;

  ros::Publisher clock_publisher_, scan_publisher_, truth_publisher_, walls_publisher_,
      obstacles_publisher_;
  ros::Subscriber command_subscriber_, odometry_subscriber_;
  ros::ServiceServer reset_service_, pause_service_;
  tf2_ros::TransformBroadcaster transform_broadcaster_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

}  // namespace tunnel_pilot::shell
