#include <cmath>
#include <optional>
#include <utility>

#include "experiments.h"
#include "tunnel_pilot/vehicle/articulation.h"

namespace tunnel_pilot::simulation {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kStart = 6.0;     // an open line is swept from here ... [m]
constexpr double kOpenEnd = 30.0;  // ... to so far before its end [m]

// A truck led along a line with a weave: its front axle's pose at each way driven.
class Weave {
 public:
  Weave(const geometry::Path& line, const PerceptionExperiment& experiment)
      : line_(line), amplitude_(experiment.weave_offset), number_(kTwoPi / experiment.weave_length) {}

  Truth at(double station, Stamp stamp) const {
    const geometry::PathPoint foot = line_.at(station);
    Truth truth;
    truth.stamp = stamp;
    truth.on_design_line = true;
    truth.station = station;
    truth.lateral_offset = amplitude_ * std::sin(number_ * station);
    const double slope = amplitude_ * number_ * std::cos(number_ * station);
    truth.heading_error = std::atan2(slope, 1.0 - foot.curvature * truth.lateral_offset);
    truth.curvature = foot.curvature;
    truth.state.pose = geometry::Pose{foot.x, foot.y, foot.heading}.compose(
        {0.0, truth.lateral_offset, truth.heading_error});
    return truth;
  }

 private:
  const geometry::Path& line_;
  double amplitude_;
  double number_;
};

// Dead reckoning from the speed and gyro sensors with their errors, as the bridge does it.
class SensedOdometry {
 public:
  SensedOdometry(const SimulatorParameters& parameters, std::uint64_t seed)
      : speed_(parameters.speed, seed, Stream::kSpeed), gyro_(parameters.gyro, seed, Stream::kGyro) {}

  // The true motion since the last call, `dt` [s] ago.
  geometry::Pose update(const geometry::Pose& motion, double dt) {
    if (dt <= 0.0) return pose_;
    const double distance = std::hypot(motion.x, motion.y);
    const double turn = gyro_.measure(motion.heading / dt, dt) * dt;
    // Direction of the chord to the body, and the sensed length along it.
    const double direction = std::atan2(motion.y, motion.x) + 0.5 * (turn - motion.heading);
    const double length = speed_.measure(distance / dt, dt) * dt;
    pose_ = pose_.compose({length * std::cos(direction), length * std::sin(direction), turn});
    return pose_;
  }

 private:
  Sensor speed_;
  Sensor gyro_;
  geometry::Pose pose_;
};

TrackSample trackSample(const Truth& truth, const vehicle::TruckGeometry& truck, double time,
                        double articulation, double speed) {
  vehicle::PlantState state;
  state.pose = truth.state.pose;
  state.articulation = articulation;
  state.speed = speed;
  TrackSample sample = sampleOf(state, truck);
  sample.time = time;
  sample.station = truth.station;
  sample.lateral_offset = truth.lateral_offset;
  sample.heading_error = truth.heading_error;
  sample.curvature = truth.curvature;
  return sample;
}

// One episode: the truck led along the line, its lidar, and the perception.
class Sweep {
 public:
  Sweep(const PerceptionExperiment& experiment, const Setup& setup, std::uint64_t seed, bool reversed)
      : experiment_(experiment),
        truck_(setup.truck.geometry),
        sensor_{truck_.lidar_x, truck_.lidar_y, 0.0},
        world_(world::loadWorld(experiment.world_file, {seed, reversed})),
        period_(1.0 / setup.simulator.lidar.rate),
        latency_(fromSeconds(setup.simulator.lidar.latency)),
        caster_(world_.walls, LidarModel::beams(setup.simulator.lidar)),
        lidar_(setup.simulator.lidar, seed),
        chain_(setup.pilot.perception),
        odometry_(setup.simulator, seed),
        weave_(world_.design_line, experiment) {}

  EpisodeResult run() {
    const geometry::Path& line = world_.design_line;
    const double start = line.closed() ? 0.0 : kStart;
    const double rest = line.closed() ? line.length() : line.length() - kOpenEnd - start;
    const double way = experiment_.distance > 0.0 ? experiment_.distance : rest;
    for (int i = 0; experiment_.speed * period_ * i < way; ++i) {
      takeScan(start + experiment_.speed * period_ * i, fromSeconds(period_ * i));
    }
    result_.metrics = perceptionMetrics(result_.perception);
    result_.ending = "way swept";
    result_.line = line;
    result_.walls = world_.walls;
    return std::move(result_);
  }

 private:
  void takeScan(double station, Stamp stamp) {
    const Truth truth = weave_.at(station, stamp);
    const geometry::Pose& pose = truth.state.pose;
    const double sweep = experiment_.speed * lidar_.sweepDuration();
    const geometry::Pose later = weave_.at(station + sweep, stamp).state.pose;
    const geometry::Scan& scan =
        lidar_.sweep(caster_, pose.compose(sensor_), later.compose(sensor_), truck_.lidar_z, 0.0, stamp);
    const geometry::Pose moved = last_pose_ ? last_pose_->relative(pose) : geometry::Pose{};
    const geometry::Pose odom = odometry_.update(moved, last_pose_ ? period_ : 0.0);
    const perception::Tunnel* tunnel = chain_.update(scan, sensor_, odom, stamp + latency_);
    const perception::TunnelState state = tunnel != nullptr ? tunnel->state : perception::TunnelState{};
    result_.perception.push_back(comparePerception(state, truth, world_.widthAt(truth.station)));
    const double way = std::hypot(moved.x, moved.y);
    if (way > 0.0) {
      articulation_ += way * vehicle::articulationSlope(truck_, moved.heading / way, articulation_);
    }
    result_.track.push_back(
        trackSample(truth, truck_, toSeconds(stamp), articulation_, experiment_.speed));
    last_pose_ = pose;
  }

  PerceptionExperiment experiment_;
  vehicle::TruckGeometry truck_;
  geometry::Pose sensor_;
  world::World world_;
  double period_;  // [s]
  Stamp latency_;
  world::RayCaster caster_;
  LidarModel lidar_;
  PerceptionChain chain_;
  SensedOdometry odometry_;
  Weave weave_;
  std::optional<geometry::Pose> last_pose_;
  double articulation_ = 0.0;  // with which the rear body follows [rad]
  EpisodeResult result_;
};

}  // namespace

PerceptionSample comparePerception(const perception::TunnelState& measured, const Truth& truth,
                                   double width) {
  PerceptionSample sample;
  sample.stamp = truth.stamp;
  sample.station = truth.station;
  sample.curvature = truth.curvature;
  sample.valid = measured.valid && measured.stamp == truth.stamp;
  if (!sample.valid) return sample;
  sample.offset_error = measured.lateral_offset - truth.lateral_offset;
  sample.heading_error = geometry::wrapAngle(measured.heading_error - truth.heading_error);
  sample.width_error = measured.width - width;
  sample.curvature_error = measured.curvature - truth.curvature;
  return sample;
}

EpisodeResult runPerception(const PerceptionExperiment& experiment, const Setup& setup,
                            std::uint64_t seed, bool reversed) {
  return Sweep(experiment, setup, seed, reversed).run();
}

}  // namespace tunnel_pilot::simulation
