#include <cmath>

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

EpisodeResult runPerception(const PerceptionExperiment& experiment, const Scenario&, const Setup& setup,
                            std::uint64_t seed, bool reversed) {
  const world::World world = world::loadWorld(experiment.world_file, {seed, reversed});
  const geometry::Path& line = world.design_line;
  const vehicle::TruckGeometry& truck = setup.truck.geometry;
  const geometry::Pose sensor{truck.lidar_x, truck.lidar_y, 0.0};
  const world::RayCaster caster(world.walls, LidarModel::beams(setup.simulator.lidar));
  LidarModel lidar(setup.simulator.lidar, seed);
  PerceptionChain chain(setup.pilot.perception);
  SensedOdometry odometry(setup.simulator, seed);
  const Weave weave(line, experiment);

  const double period = 1.0 / setup.simulator.lidar.rate;
  const double start = line.closed() ? 0.0 : kStart;
  const double end = experiment.distance > 0.0 ? start + experiment.distance
                     : line.closed()           ? line.length()
                                               : line.length() - kOpenEnd;
  EpisodeResult result;
  geometry::Pose last = weave.at(start, {}).state.pose;
  double articulation = 0.0;
  for (int i = 0; start + experiment.speed * period * i < end; ++i) {
    const Stamp stamp = fromSeconds(period * i);
    const double station = start + experiment.speed * period * i;
    const Truth truth = weave.at(station, stamp);
    const geometry::Pose later =
        weave.at(station + experiment.speed * lidar.sweepDuration(), stamp).state.pose;
    const geometry::Scan& scan = lidar.sweep(caster, truth.state.pose.compose(sensor),
                                             later.compose(sensor), truck.lidar_z, 0.0, stamp);
    const geometry::Pose moved = last.relative(truth.state.pose);
    const geometry::Pose odom = odometry.update(moved, i == 0 ? 0.0 : period);
    const perception::Tunnel* tunnel =
        chain.update(scan, sensor, odom, stamp + fromSeconds(setup.simulator.lidar.latency));
    result.perception.push_back(comparePerception(
        tunnel != nullptr ? tunnel->state : perception::TunnelState{}, truth, world.width));
    const double way = std::hypot(moved.x, moved.y);
    if (way > 0.0)
      articulation += way * vehicle::articulationSlope(truck, moved.heading / way, articulation);
    result.track.push_back(trackSample(truth, truck, period * i, articulation, experiment.speed));
    last = truth.state.pose;
  }
  result.metrics = perceptionMetrics(result.perception);
  result.ending = "way swept";
  result.line = line;
  result.walls = world.walls;
  return result;
}

}  // namespace tunnel_pilot::simulation
