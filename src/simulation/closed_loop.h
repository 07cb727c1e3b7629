#pragma once

#include <memory>
#include <optional>
#include <string>

#include "experiments.h"
#include "tunnel_pilot/can/log_writer.h"
#include "tunnel_pilot/can/memory_bus.h"

namespace tunnel_pilot::simulation {

/// The simulated truck, the pilot, and the bus between them: what both closed-loop experiments share.
class ClosedLoop {
 public:
  ClosedLoop(const Scenario& scenario, const Setup& setup, const PilotParameters& pilot,
             world::World world, const EpisodePlan& plan);
  virtual ~ClosedLoop() = default;

 protected:
  /// Somebody else drives straight up to `start` at `speed` [m/s] (0: the truck waits there), hands over
  /// on reaching it, and drives on until the truck obeys the pilot: that is the drive's time zero. False
  /// when the pilot could not be engaged.
  bool handOver(const geometry::Pose& start, double speed);

  /// One step of the simulator, and what the pilot does about it.
  void step();

  /// What the pilot is told of a scan.
  virtual void takeScan(const geometry::Scan& scan) = 0;
  virtual void takeTruth() {}  ///< recorded, while driving
  /// Called with every new truth once the truck obeys.
  void record();

  /// Tells the log that a measurement of this stamp is about to be taken.
  void logMeasurement(Stamp stamp);

  /// Why the drive cannot go on, in words; empty while it can.
  std::string whyOver(double time_limit) const;

  double time() const { return toSeconds(simulator_.now() - start_time_); }  ///< since the hand-over [s]

  vehicle::TruckGeometry truck_;
  can::MemoryBusHub hub_;
  std::unique_ptr<can::Bus> truck_side_;
  std::unique_ptr<can::Bus> pilot_side_;
  Simulator simulator_;
  Pilot pilot_;
  bool driving_ = false;
  std::vector<TrackSample> track_;

 private:
  void driveUp(double speed);
  void logEvent(const std::string& words);
  void logPilot();             ///< a stop it asked for, then its frames
  void logFrames(Stamp when);  ///< all that waits

  std::optional<can::LogWriter> log_;
  std::unique_ptr<can::Bus> log_side_;  ///< listens, where there is a log
  bool stop_commanded_ = false;
  double missed_way_ = 0.0;  ///< speed error integrated while driving up [m]
  Stamp next_tick_{};
  Stamp start_time_{};
  std::uint32_t start_contacts_ = 0;
};

}  // namespace tunnel_pilot::simulation
