#pragma once

#include <poll.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tunnel_pilot/Proposal.h>
#include <tunnel_pilot/TunnelState.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "tunnel_pilot/can/codec.h"
#include "tunnel_pilot/can/embedded_bus.h"

namespace tunnel_pilot::shell {

enum class WireFault {
  kNone,
  kSilent,
  kCorrupt,
  kForeignSender,
  kTruckFault,
  kOverride,
  kHingeElsewhere
};

/// The cable between the truck's bus and the pilot's, on which what the truck says is spoilt.
class SpoiltWire {
 public:
  /// The buses are called after `bus`: _truck and _pilot.
  explicit SpoiltWire(const std::string& bus)
      : truck_(bus + "_truck"), pilot_(bus + "_pilot"), thread_([this] { carry(); }) {}
  ~SpoiltWire() {
    ends_ = true;
    thread_.join();
  }
  SpoiltWire(const SpoiltWire&) = delete;
  SpoiltWire& operator=(const SpoiltWire&) = delete;

  void set(WireFault fault) { fault_ = fault; }

 private:
  void carry() {
    while (!ends_) {
      pollfd readable[2] = {{truck_.descriptor(), POLLIN, 0}, {pilot_.descriptor(), POLLIN, 0}};
      poll(readable, 2, 20);
      while (const auto frame = pilot_.receive()) truck_.send(*frame);
      while (const auto frame = truck_.receive()) toPilot(*frame);
    }
  }

  void toPilot(can::Frame frame) {
    switch (fault_.load()) {
      case WireFault::kNone:
        break;
      case WireFault::kSilent:
        return;
      case WireFault::kCorrupt:  // every other one, so that it is not silent
        if (frame.id == can::kTruckMotionId && ++motion_frames_ % 2 == 0) frame.data[3] ^= 1u;
        break;
      case WireFault::kForeignSender:
        if (frame.id == can::kTruckStatusId) pilot_.send(*can::encode(can::TruckCommandFrame()));
        break;
      case WireFault::kTruckFault:
        change<can::TruckStatusFrame>(frame, [](auto& told) { told.faults |= can::kFaultSteering; });
        break;
      case WireFault::kOverride:
        change<can::TruckFeedbackFrame>(frame, [](auto& told) { told.operator_override = true; });
        break;
      case WireFault::kHingeElsewhere:
        change<can::TruckFeedbackFrame>(frame, [](auto& told) { told.articulation_angle += 0.11; });
        break;
    }
    pilot_.send(frame);
  }

  template <class Fields, class Change>
  static void change(can::Frame& frame, const Change& how) {
    auto fields = can::decode<Fields>(frame);
    if (!fields) return;
    how(*fields);
    if (const auto changed = can::encode(*fields)) frame = *changed;
  }

  can::EmbeddedBus truck_, pilot_;
  std::atomic<WireFault> fault_{WireFault::kNone};
  unsigned motion_frames_ = 0;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

/// Serves callbacks beside the test's own: the pilot waits for what they pass on, whatever the test
/// waits for.
class BesideTheTest {
 protected:
  BesideTheTest() : spinner_(1, &queue_) {
    nh_.setCallbackQueue(&queue_);
    spinner_.start();
  }

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::AsyncSpinner spinner_;
};

enum class View { kClear, kDead, kBlind, kFrozen, kOpen, kBox };

/// Passes the simulator's scans (`lidar`) on to the pilot (`scan`), as they are or with something in
/// view.
class SpoiltLidar : private BesideTheTest {
 public:
  SpoiltLidar() : publisher_(nh_.advertise<sensor_msgs::LaserScan>("scan", 2)) {
    const boost::function<void(const sensor_msgs::LaserScan&)> pass = [this](const auto& scan) {
      passOn(scan);
    };
    subscriber_ = nh_.subscribe<sensor_msgs::LaserScan>("lidar", 5, pass, ros::VoidConstPtr(),
                                                        ros::TransportHints().tcpNoDelay());
  }
  ~SpoiltLidar() { spinner_.stop(); }

  void set(View view) { view_ = view; }

 private:
  void passOn(sensor_msgs::LaserScan scan) {
    const View view = view_;
    if (view == View::kDead) return;
    if (view == View::kFrozen) scan.ranges = last_ranges_;
    last_ranges_ = scan.ranges;
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      const double angle = scan.angle_min + static_cast<double>(i) * scan.angle_increment;
      scan.ranges[i] = seen(view, angle, scan.ranges[i]);
    }
    publisher_.publish(scan);
  }

  // Lengths in metres from the lidar, which is at the nose.
  static float seen(View view, double angle, float range) {
    constexpr double kBoxAhead = 2.0, kBoxHalf = 0.5, kFarAway = 30.0;
    switch (view) {
      case View::kBlind:
        return std::numeric_limits<float>::quiet_NaN();
      case View::kOpen:
        return std::isfinite(range) ? static_cast<float>(kFarAway + 0.01 * range) : range;
      case View::kBox:
        if (std::abs(kBoxAhead * std::tan(angle)) > kBoxHalf || std::cos(angle) < 0.5) return range;
        return static_cast<float>(kBoxAhead / std::cos(angle) + 1e-3 * range);
      default:
        return range;
    }
  }

  std::atomic<View> view_{View::kClear};
  std::vector<float> last_ranges_;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
};

enum class Part {
  kNone,
  kLidarDriver,              ///< the real preview driver's proposals under the lidar driver's name
  kUnsureLidarDriver,        ///< ... with little confidence
  kOtherLidarDriver,         ///< ... elsewhere
  kBothDrivers,              ///< as kPreviewDriver, and the same under the lidar driver's name
  kUnableDrivers,            ///< ... not valid
  kPreviewDriver,            ///< along the middle of the tunnel
  kImpossiblePreviewDriver,  ///< not a number
  kWildPreviewDriver,        ///< wider than the hinge turns
};

/// Plays a driver that was unloaded.
class Understudy : private BesideTheTest {
 public:
  Understudy()
      : lidar_driver_(nh_.advertise<Proposal>("lidar_driver/proposal", 1)),
        preview_driver_(nh_.advertise<Proposal>("preview_driver/proposal", 1)) {
    const boost::function<void(const Proposal&)> on_proposal = [this](const Proposal& real) {
      playLidarDriver(real);
    };
    const boost::function<void(const TunnelState&)> on_tunnel = [this](const TunnelState& tunnel) {
      playPreviewDriver(tunnel);
    };
    const auto hints = ros::TransportHints().tcpNoDelay();
    subscribers_ = {
        nh_.subscribe<Proposal>("preview_driver/proposal", 1, on_proposal, ros::VoidConstPtr(), hints),
        nh_.subscribe<TunnelState>("tunnel_state", 1, on_tunnel, ros::VoidConstPtr(), hints)};
  }
  ~Understudy() { spinner_.stop(); }

  void play(Part part) { part_ = part; }

 private:
  void playLidarDriver(Proposal proposal) {
    const Part part = part_;
    if (part == Part::kUnsureLidarDriver) proposal.confidence = 0.1;
    if (part == Part::kOtherLidarDriver) proposal.articulation_angle += 0.2;
    if (part >= Part::kLidarDriver && part <= Part::kUnableDrivers) lidar_driver_.publish(proposal);
  }

  void playPreviewDriver(const TunnelState& tunnel) {
    const Part part = part_;
    if (part < Part::kBothDrivers) return;
    Proposal proposal;
    proposal.header = tunnel.header;
    proposal.valid = tunnel.valid && part != Part::kUnableDrivers;
    proposal.articulation_angle = -0.2 * tunnel.lateral_offset - 1.2 * tunnel.heading_error;
    proposal.speed = 1.5;
    proposal.confidence = 1.0;
    if (part == Part::kImpossiblePreviewDriver)
      proposal.speed = std::numeric_limits<double>::quiet_NaN();
    if (part == Part::kWildPreviewDriver) proposal.articulation_angle = 1.0;
    preview_driver_.publish(proposal);
  }

  std::atomic<Part> part_{Part::kNone};
  ros::Publisher lidar_driver_, preview_driver_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace tunnel_pilot::shell
