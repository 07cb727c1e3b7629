#include <algorithm>

#include "closed_loop.h"
#include "tunnel_pilot/simulation/ideal_drive.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr double kOpenEnd = 30.0;  // an open line is driven up to so far before its end [m]

PilotParameters withTopSpeed(PilotParameters parameters, double top_speed) {
  parameters.preview_driver.speed = top_speed;
  parameters.lidar_driver.speed = top_speed;
  return parameters;
}

class Drive : public ClosedLoop {
 public:
  Drive(const DriveExperiment& drive, const Scenario& scenario, const Setup& setup,
        const EpisodePlan& plan, DriveObserver* observer)
      : ClosedLoop(scenario, setup, withTopSpeed(setup.pilot, drive.top_speed),
                   world::loadWorld(drive.world_file, {plan.seed, plan.reversed}), plan),
        drive_(drive),
        sight_(setup.pilot.perception.wall_segmentation.lookahead),
        acceleration_(setup.pilot.arbiter.limiter.max_acceleration),
        governor_(setup.pilot.arbiter.governor),
        observer_(observer) {
    const double length = simulator_.world().design_line.length();
    if (drive.station <= length) return;
    throw config::ConfigError(scenario.file + ": 'experiment.station' [m] lies beyond the end of the " +
                              "design line of " + drive.world_file + " at " + std::to_string(length) +
                              " m");
  }

  EpisodeResult run() {
    EpisodeResult result;
    result.ending = "not engaged";
    const geometry::Pose start =
        simulator_.poseOnLine(drive_.station, drive_.lateral_offset, drive_.heading_error);
    if (handOver(start, drive_.rolling_speed)) result.ending = driveOn();
    const world::World& world = simulator_.world();
    result.metrics = metrics(result.ending);
    result.track = std::move(track_);
    result.perception = std::move(perception_);
    result.line = world.design_line;
    result.walls = world.walls;
    return result;
  }

 private:
  void takeScan(const geometry::Scan& scan) override {
    logMeasurement(scan.stamp);
    pilot_.takeScan(scan, simulator_.now());
    if (!driving_) return;
    const Truth& truth = simulator_.truthOfScan();
    perception_.push_back(
        comparePerception(pilot_.tunnel().state, truth, simulator_.world().widthAt(truth.station)));
    if (observer_) observer_->afterScan(simulator_, pilot_);
  }

  std::string driveOn() {
    start_ = simulator_.truth().station;
    const geometry::Path& line = simulator_.world().design_line;
    way_ = drive_.distance > 0.0 ? drive_.distance
           : line.closed()       ? line.length()
                                 : line.length() - start_ - kOpenEnd;
    while (true) {
      step();
      if (simulator_.truth().station - start_ >= way_) return kCompleted;
      std::string why = whyOver(drive_.time_limit);
      if (!why.empty()) return why;
    }
  }

  Metrics metrics(const std::string& ending) const {
    Metrics metrics = driveMetrics(track_, simulator_.world().design_line);
    if (drive_.return_metrics) metrics.merge(returnMetrics(track_));
    metrics["valid_share"] = perceptionMetrics(perception_).at("valid_share");
    metrics["contacts"] = ending == "contact" ? 1.0 : 0.0;
    metrics["completed"] = ending == kCompleted ? 1.0 : 0.0;
    if (ending.rfind("stopped", 0) == 0) metrics["stops"] = std::max(metrics["stops"], 1.0);
    if (ending == kCompleted) {
      metrics["lap_time"] = time();
      metrics["lap_efficiency"] = idealTime() / time();
    }
    if (pilot_.lidarDriver()) metrics["lidar_driver_share"] = lidarDriverShare();
    return metrics;
  }

  static constexpr const char* kCompleted = "way driven";

  double idealTime() const {
    return idealDriveTime(simulator_.world().design_line,
                          {start_, way_, drive_.rolling_speed, drive_.top_speed, acceleration_, sight_},
                          governor_, truck_);
  }

  double lidarDriverShare() const {
    return track_.empty() ? 0.0
                          : static_cast<double>(by_lidar_driver_) / static_cast<double>(track_.size());
  }

  void takeTruth() override {
    if (pilot_.decision().command.source == supervision::Source::kLidarDriver) ++by_lidar_driver_;
    if (observer_) observer_->afterTruth(simulator_);
  }

  DriveExperiment drive_;
  double sight_;         ///< how far the perception follows walls [m]
  double acceleration_;  ///< that the arbiter allows [m/s^2]
  supervision::SpeedGovernor governor_;
  double start_ = 0.0;  ///< station [m]
  double way_ = 0.0;    ///< [m]
  DriveObserver* observer_;
  std::size_t by_lidar_driver_ = 0;  ///< truths while it steered
  std::vector<PerceptionSample> perception_;
};

}  // namespace

EpisodeResult runDrive(const DriveExperiment& drive, const Scenario& scenario, const Setup& setup,
                       const EpisodePlan& plan, DriveObserver* observer) {
  return Drive(drive, scenario, setup, plan, observer).run();
}

}  // namespace tunnel_pilot::simulation
