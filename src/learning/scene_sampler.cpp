#include "tunnel_pilot/learning/scene_sampler.h"

#include <algorithm>
#include <cmath>

#include "tunnel_pilot/drivers/articulation_profile.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/simulation/lidar_model.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/sensors.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::learning {
namespace {

using simulation::Random;
using simulation::Stream;

constexpr double kStart = 8.0;   // sampled from here on ... [m]
constexpr double kEnd = 30.0;    // ... to so far before an open line's end [m]

// Mostly near, sometimes far: the cube of a uniform number has its heart at zero.
double spreadOut(Random& random, double largest) {
  const double u = random.uniform(-1.0, 1.0);
  return largest * u * std::abs(u);
}

}  // namespace

DataSet sampleScenes(const std::string& world_file, std::uint64_t seed, std::size_t count,
                     const simulation::Setup& setup, const SceneSpread& spread) {
  Random random(seed, Stream::kScene);
  const world::World world = world::loadWorld(world_file, {seed, random.uniform() < 0.5});
  const geometry::Path& line = world.design_line;
  const auto& truck = setup.truck.geometry;
  const auto& sim = setup.simulator;
  const world::RayCaster caster(world.walls, simulation::LidarModel::beams(sim.lidar));
  simulation::LidarModel lidar(sim.lidar, seed);
  perception::ScanFilter filter(setup.pilot.perception.scan_filter);
  drivers::ArticulationProfile profile;
  profile.build(line, truck, 0.25);
  Teacher teacher(setup.pilot.preview_driver, truck);
  simulation::Sensor articulation(sim.articulation, seed, Stream::kArticulation);
  simulation::Sensor speed(sim.speed, seed, Stream::kSpeed);
  const geometry::Pose sensor{truck.lidar_x, truck.lidar_y, 0.0};
  const double last = line.length() - (line.closed() ? 0.0 : kEnd);
  const double ahead = sim.lidar.latency + setup.pilot.preview_driver.truck.steering.transport_delay +
                       setup.pilot.preview_driver.truck.steering.dead_time;

  DataSet examples;
  Stamp stamp{};
  while (examples.size() < count) {
    stamp += std::chrono::milliseconds(30);
    TruckBesideLine state;
    state.station = random.uniform(line.closed() ? 0.0 : kStart, last);
    state.offset = spreadOut(random, spread.offset);
    state.heading_error = spreadOut(random, spread.heading);
    state.speed = random.uniform(spread.speed_min, spread.speed_max);
    const double profile_rate =
        (profile.at(state.station + 0.5) - profile.at(state.station - 0.5)) * state.speed;
    const drivers::YawResponse response{random.uniform(spread.gain_min, spread.gain_max),
                                        spreadOut(random, spread.disturbance)};
    const double wanted = vehicle::steadyCurvature(truck, profile.at(state.station));
    const double followed =
        vehicle::steadyArticulation(truck, (wanted - response.disturbance) / response.gain);
    state.articulation = followed + spreadOut(random, spread.articulation);
    state.articulation_rate = profile_rate + spreadOut(random, spread.rate);
    const geometry::PathPoint foot = line.at(state.station);
    const geometry::Pose pose =
        geometry::Pose{foot.x, foot.y, foot.heading}.compose({0.0, state.offset, state.heading_error});
    const double yaw_rate =
        response.gain * vehicle::yawRate(truck, state.speed, state.articulation, state.articulation_rate);
    const double sweep = lidar.sweepDuration();
    const geometry::Pose later = pose.compose({state.speed * sweep, 0.0, yaw_rate * sweep});
    const geometry::Scan& scan = lidar.sweep(caster, pose.compose(sensor), later.compose(sensor),
                                             truck.lidar_z, 0.01 * random.normal(), stamp);
    const auto& filtered = filter.filter(scan, sensor, stamp);
    if (!filtered.accepted) continue;
    Example example;
    example.ranges = filtered.network_scan.ranges;
    const double latency = sim.lidar.latency;
    // Of the sensor's bias the driver has learned about half.
    const double bias = 0.5 * articulation.bias();
    example.articulation = static_cast<float>(
        articulation.measure(state.articulation + state.articulation_rate * latency, 0.02) - bias);
    const TruckBesideLine then = teacher.movedOn(line, state, response, ahead);
    example.articulation_ahead = static_cast<float>(
        then.articulation + articulation.bias() - bias + spread.ahead_error * random.normal());
    example.speed = static_cast<float>(speed.measure(state.speed, 0.02));
    example.yaw_gain = static_cast<float>(response.gain);
    example.yaw_disturbance = static_cast<float>(response.disturbance);
    example.label = static_cast<float>(teacher.command(line, then, response));
    if (!std::isfinite(example.label)) continue;
    example.tunnel = static_cast<std::uint32_t>(seed);
    examples.push_back(std::move(example));
  }
  return examples;
}

}  // namespace tunnel_pilot::learning
