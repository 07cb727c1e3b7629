#include "tunnel_pilot/learning/scene_sampler.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "tunnel_pilot/drivers/articulation_profile.h"
#include "tunnel_pilot/perception/scan_filter.h"
#include "tunnel_pilot/simulation/lidar_model.h"
#include "tunnel_pilot/simulation/random.h"
#include "tunnel_pilot/simulation/sensors.h"
#include "tunnel_pilot/supervision/speed_governor.h"
#include "tunnel_pilot/vehicle/articulation.h"
#include "tunnel_pilot/world/world.h"

namespace tunnel_pilot::learning {
namespace {

using simulation::Random;
using simulation::Stream;

constexpr double kStart = 8.0;  // sampled from here on ... [m]
constexpr double kEnd = 30.0;   // ... to so far before an open line's end [m]

// Mostly near, sometimes far: the cube of a uniform number has its heart at zero.
double spreadOut(Random& random, double largest) {
  const double u = random.uniform(-1.0, 1.0);
  return largest * u * std::abs(u);
}

class Sampler {
 public:
  Sampler(const std::string& world_file, std::uint64_t seed, const simulation::Setup& setup,
          const TeacherParameters& teacher, const SceneSpread& spread)
      : setup_(setup),
        spread_(spread),
        truck_(setup.truck.geometry),
        random_(seed, Stream::kScene),
        world_(world::loadWorld(world_file, {seed, random_.uniform() < 0.5})),
        line_(world_.design_line),
        caster_(world_.walls, simulation::LidarModel::beams(setup.simulator.lidar)),
        lidar_(setup.simulator.lidar, seed),
        filter_(setup.pilot.perception.scan_filter),
        teacher_(teacher, setup.pilot.preview_driver, truck_),
        governor_(setup.pilot.arbiter.governor),
        articulation_(setup.simulator.articulation, seed, Stream::kArticulation),
        speed_(setup.simulator.speed, seed, Stream::kSpeed),
        seed_(seed) {
    profile_.build(line_, truck_, 0.25);
  }

  DataSet run(std::size_t count) {
    DataSet examples;
    while (examples.size() < count) {
      TruckBesideLine truck = start();
      const drivers::YawResponse response{random_.uniform(spread_.gain_min, spread_.gain_max),
                                          spreadOut(random_, spread_.disturbance)};
      const double lean = spreadOut(random_, spread_.lean);
      const double fastest = setup_.pilot.preview_driver.truck.steering.max_rate;
      steering_rate_ = fastest * (1.0 - random_.uniform(0.0, spread_.slower));
      teacher_.setMaxRate(steering_rate_);
      for (int i = 0; i < kMoments && inside(truck); ++i) {
        std::optional<Example> example = look(truck, response);
        if (!example) break;
        const double demand =
            static_cast<double>(example->label) + lean + spreadOut(random_, spread_.lean);
        examples.push_back(std::move(*example));
        truck = teacher_.steered(line_, truck, response, demand, kMoment);
      }
    }
    examples.resize(count);
    return examples;
  }

 private:
  static constexpr int kMoments = 16;
  static constexpr double kMoment = 0.3;  // [s]

  double last() const { return line_.length() - (line_.closed() ? 0.0 : kEnd); }

  TruckBesideLine start() {
    TruckBesideLine truck;
    truck.station = random_.uniform(line_.closed() ? 0.0 : kStart, last());
    truck.offset = spreadOut(random_, spread_.offset);
    truck.heading_error = spreadOut(random_, spread_.heading);
    const double allowed = governor_.alongPath(profile_, truck.station).speed;
    truck.speed = std::min(random_.uniform(spread_.speed_min, spread_.speed_max), allowed);
    truck.articulation = profile_.at(truck.station) + spreadOut(random_, spread_.articulation);
    return truck;
  }

  bool inside(const TruckBesideLine& truck) const {
    const double nose = truck.offset + truck_.front_overhang * std::sin(truck.heading_error);
    return truck.station < last() && std::abs(nose) < 0.5 * world_.width - 0.5 * truck_.overall_width;
  }

  std::optional<Example> look(const TruckBesideLine& truck, const drivers::YawResponse& response) {
    const auto& sim = setup_.simulator;
    const auto& steering = setup_.pilot.preview_driver.truck.steering;
    stamp_ += std::chrono::milliseconds(30);
    const geometry::PathPoint foot = line_.at(truck.station);
    const geometry::Pose pose =
        geometry::Pose{foot.x, foot.y, foot.heading}.compose({0.0, truck.offset, truck.heading_error});
    const double yaw_rate = response.gain * vehicle::yawRate(truck_, truck.speed, truck.articulation,
                                                             truck.articulation_rate);
    const double sweep = lidar_.sweepDuration();
    const geometry::Pose later = pose.compose({truck.speed * sweep, 0.0, yaw_rate * sweep});
    const geometry::Pose sensor{truck_.lidar_x, truck_.lidar_y, 0.0};
    const geometry::Scan& scan = lidar_.sweep(caster_, pose.compose(sensor), later.compose(sensor),
                                              truck_.lidar_z, 0.01 * random_.normal(), stamp_);
    const auto& filtered = filter_.filter(scan, sensor, stamp_);
    if (!filtered.accepted) return std::nullopt;
    const double ahead = sim.lidar.latency + steering.transport_delay + steering.dead_time;
    const TruckBesideLine then = teacher_.movedOn(line_, truck, response, ahead);
    const double bias = spread_.bias_error * articulation_.bias();  // what the driver has not learned
    Example example;
    example.ranges = filtered.network_scan.ranges;
    example.articulation = static_cast<float>(
        articulation_.measure(truck.articulation + truck.articulation_rate * sim.lidar.latency, 0.02) -
        articulation_.bias() + bias);
    example.articulation_ahead =
        static_cast<float>(then.articulation + bias + spread_.ahead_error * random_.normal());
    example.speed = static_cast<float>(speed_.measure(truck.speed, 0.02));
    example.yaw_gain = static_cast<float>(response.gain);
    example.yaw_disturbance = static_cast<float>(response.disturbance);
    example.steering_rate = static_cast<float>(steering_rate_);
    example.label = static_cast<float>(teacher_.command(line_, then, response));
    example.tunnel = static_cast<std::uint32_t>(seed_);
    if (!std::isfinite(example.label)) return std::nullopt;
    return example;
  }

  const simulation::Setup& setup_;
  SceneSpread spread_;
  vehicle::TruckGeometry truck_;
  Random random_;
  world::World world_;
  const geometry::Path& line_;
  world::RayCaster caster_;
  simulation::LidarModel lidar_;
  perception::ScanFilter filter_;
  drivers::ArticulationProfile profile_;
  Teacher teacher_;
  supervision::SpeedGovernor governor_;
  simulation::Sensor articulation_;
  simulation::Sensor speed_;
  std::uint64_t seed_;
  double steering_rate_ = 0.0;  // of the truck put there [rad/s]
  Stamp stamp_{};
};

}  // namespace

DataSet sampleScenes(const std::string& world_file, std::uint64_t seed, std::size_t count,
                     const simulation::Setup& setup, const TeacherParameters& teacher,
                     const SceneSpread& spread) {
  return Sampler(world_file, seed, setup, teacher, spread).run(count);
}

}  // namespace tunnel_pilot::learning
