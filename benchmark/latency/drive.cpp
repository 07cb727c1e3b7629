// Drives the pilot through the simulated drift in real time and sends each scan to three: to the pilot,
// to the peer and to the stages with one thread, a third of a period after one another, so that each has
// the machine for itself as far as the machine allows. Notes when a scan was sent and when the command
// that stems from it was received here. Who steers changes every ten seconds.
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <tunnel_pilot/TruckCommand.h>
#include <tunnel_pilot/TruckStatus.h>

#include <atomic>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "log.h"
#include "tunnel_pilot/can/embedded_bus.h"
#include "tunnel_pilot/ros/conversions.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/simulation/scenario.h"
#include "tunnel_pilot/simulation/simulator.h"

namespace tunnel_pilot::benchmark {
namespace {

constexpr double kTurn = 10.0;       // [s] that one driver steers
constexpr double kSettling = 5.0;    // [s] of driving that is not measured
constexpr double kPatience = 120.0;  // [s] until the truck must drive
constexpr std::uint64_t kSeed = 1;

Stamp steadyNow() { return std::chrono::steady_clock::now().time_since_epoch(); }

class Drive {
 public:
  Drive() {
    const std::string package = ros::param::param<std::string>("~package", "");
    const auto scenario = simulation::loadScenario(package + "/scenarios/default_drift.yaml");
    const auto setup = simulation::loadSetup(scenario);
    simulator_ = std::make_unique<simulation::Simulator>(
        setup.simulator, setup.truck_controller, setup.truck,
        simulation::makePlant(scenario.plant, setup.truck, kSeed), scenario.plant.load,
        world::loadWorld(package + "/worlds/default_drift.yaml", {kSeed, false}), kSeed, bus_);
    simulator_->place(simulator_->startPose());
    third_ = fromSeconds(1.0 / 3.0 / setup.simulator.lidar.rate);
    const auto hints = ros::TransportHints().tcpNoDelay();
    status_ = nh_.subscribe<TruckStatus>("pilot/truck_status", 10,
                                         [this](const TruckStatus::ConstPtr& m) { state_ = m->state; });
    pilot_command_ = nh_.subscribe("pilot/command", 20, &Drive::onPilotCommand, this, hints);
    peer_command_ = nh_.subscribe("peer/command", 20, &Drive::onPeerCommand, this, hints);
  }
  ~Drive() {
    ends_ = true;
    if (thread_.joinable()) thread_.join();
  }

  /// False when the truck did not come to drive. Where the pilot stops it, it is engaged anew.
  bool run(double seconds) {
    thread_ = std::thread([this] { live(); });
    if (!comeToDrive()) return false;
    spin(kSettling);
    measuring_ = true;
    const Stamp end = steadyNow() + fromSeconds(seconds);
    for (bool preview = true; steadyNow() < end && ros::ok(); preview = !preview) {
      if (state_ != TruckStatus::STATE_ACTIVE) note("stop", ros::Time::now(), ros::Time::now());
      if (!comeToDrive()) return false;
      for (const std::string whose : {"pilot", "compute"}) {
        call(whose + "/arbiter/use/" + (preview ? "preview_driver" : "lidar_driver"));
      }
      spin(kTurn);
    }
    measuring_ = false;
    spin(0.5);
    return true;
  }

 private:
  static bool call(const std::string& service) {
    std_srvs::Trigger trigger;
    return ros::service::call(service, trigger) && trigger.response.success;
  }

  void spin(double seconds) {
    const Stamp end = steadyNow() + fromSeconds(seconds);
    while (steadyNow() < end && ros::ok()) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
    }
  }

  bool comeToDrive() {
    const Stamp end = steadyNow() + fromSeconds(kPatience);
    while (ros::ok() && steadyNow() < end && state_ != TruckStatus::STATE_ACTIVE) {
      spin(0.2);
      if (state_ == TruckStatus::STATE_STOPPED) call("pilot/reset");
      if (state_ == TruckStatus::STATE_STANDBY) call("pilot/engage");
    }
    return state_ == TruckStatus::STATE_ACTIVE;
  }

  // The truck's thread.
  void live() {
    const Stamp zero = steadyNow();
    const Stamp stamps_from = shell::toCore(ros::Time::now());
    while (!ends_) {
      const Stamp now = steadyNow() - zero;
      while (simulator_->now() < now) step(stamps_from);
      while (!waiting_.empty() && waiting_.front().due <= simulator_->now()) {
        send(waiting_.front());
        waiting_.pop_front();
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  struct Waiting {
    Stamp due;
    const char* event;
    ros::Publisher* publisher;
    sensor_msgs::LaserScan scan;
  };

  void step(Stamp stamps_from) {
    const auto& events = simulator_->step();
    if (events.scan == nullptr) return;
    geometry::Scan scan = *events.scan;
    scan.stamp += stamps_from;
    const auto message = shell::toRos(scan, "laser");
    auto for_peer = message;
    if (++scans_ % 2 == 0) for_peer.header.frame_id = "light";
    waiting_.push_back({simulator_->now(), "pilot_sent", &pilot_, message});
    waiting_.push_back({simulator_->now() + third_, scans_ % 2 == 0 ? "light_sent" : "peer_sent", &peer_,
                        std::move(for_peer)});
    waiting_.push_back({simulator_->now() + 2 * third_, "compute_sent", &compute_, message});
  }

  void send(const Waiting& waiting) {
    const ros::Time sent = ros::Time::now();
    waiting.publisher->publish(waiting.scan);
    if (measuring_ && state_ == TruckStatus::STATE_ACTIVE)
      note(waiting.event, waiting.scan.header.stamp, sent);
  }

  // A command was received when it was read off the socket.
  void onPilotCommand(const ros::MessageEvent<const TruckCommand>& event) {
    const TruckCommand& command = *event.getConstMessage();
    if (command.header.stamp == answered_ || command.stop) return;
    answered_ = command.header.stamp;
    if (!measuring_ || command.mode != TruckCommand::MODE_AUTONOMOUS) return;
    if (command.source == TruckCommand::SOURCE_PREVIEW_DRIVER)
      note("preview_received", answered_, event.getReceiptTime());
    if (command.source == TruckCommand::SOURCE_LIDAR_DRIVER)
      note("lidar_received", answered_, event.getReceiptTime());
  }

  void onPeerCommand(const ros::MessageEvent<const TruckCommand>& event) {
    if (measuring_) note("peer_received", event.getConstMessage()->header.stamp, event.getReceiptTime());
  }

  void note(const char* event, ros::Time scan, ros::Time at) {
    const std::lock_guard<std::mutex> lock(mutex_);
    log_.add(event, scan, at);
  }

  std::mutex mutex_;
  Log log_{ros::param::param<std::string>("~log", "")};
  can::EmbeddedBus bus_{ros::param::param<std::string>("~bus", "")};
  std::unique_ptr<simulation::Simulator> simulator_;
  Stamp third_{};
  std::uint64_t scans_ = 0;
  std::deque<Waiting> waiting_;
  ros::Time answered_;
  std::atomic<int> state_{-1};
  std::atomic<bool> measuring_{false}, ends_{false};
  ros::NodeHandle nh_;
  ros::Publisher pilot_ = nh_.advertise<sensor_msgs::LaserScan>("pilot/scan", 1);
  ros::Publisher peer_ = nh_.advertise<sensor_msgs::LaserScan>("peer/scan", 1);
  ros::Publisher compute_ = nh_.advertise<sensor_msgs::LaserScan>("compute/scan_in", 1);
  ros::Subscriber status_, pilot_command_, peer_command_;
  std::thread thread_;
};

}  // namespace
}  // namespace tunnel_pilot::benchmark

int main(int argc, char** argv) {
  ros::init(argc, argv, "latency_drive");
  const ros::NodeHandle keep_alive;
  try {
    tunnel_pilot::benchmark::Drive drive;
    if (drive.run(ros::param::param("~seconds", 240.0))) return 0;
    ROS_FATAL("the truck did not drive");
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
  }
  return 1;
}
