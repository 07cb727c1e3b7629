#include "tunnel_pilot/learning/human_drives.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

#include "in_parallel.h"
#include "tunnel_pilot/bridge/can_bridge.h"
#include "tunnel_pilot/can/memory_bus.h"
#include "tunnel_pilot/drivers/motion_history.h"
#include "tunnel_pilot/simulation/perception_chain.h"
#include "tunnel_pilot/simulation/pilot.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

using simulation::DriveExperiment;
using simulation::Simulator;

constexpr double kOpenEnd = 30.0;     // he stops so far before the end of the line [m]
constexpr double kWaits = 1.0;        // until the recording runs [s]
constexpr double kLook = 0.03;        // he looks up so often [s]
constexpr double kSpeedGain = 0.8;    // of his right foot [1/s]
constexpr double kStraight = 1e-4;    // curvature below which a line is straight [1/m]
constexpr double kTimeLimit = 600.0;  // [s]

// The human, the truck, and what records.
class Recording {
 public:
  Recording(const DriveExperiment& drive, const simulation::Scenario& scenario,
            const simulation::Setup& setup, const simulation::EpisodePlan& plan, const HumanHabit& habit,
            int keep_every)
      : truck_side_(hub_.connect()),
        pilot_side_(hub_.connect()),
        simulator_(setup.simulator, setup.truck_controller, setup.truck,
                   simulation::makePlant(scenario.plant, setup.truck, plan.seed), scenario.plant.load,
                   simulation_world(drive, plan), plan.seed, *truck_side_),
        bridge_(setup.pilot.bridge, setup.truck.geometry, *pilot_side_),
        perception_(setup.pilot.perception),
        sensor_{setup.truck.geometry.lidar_x, setup.truck.geometry.lidar_y, 0.0},
        line_(humanLine(simulator_.world().design_line, habit, plan.seed)),
        human_(line_, setup.pilot.preview_driver, setup.truck.geometry),
        demonstration_(
            demonstrationParameters(setup.pilot.lidar_driver.steering, setup.simulator.lidar.latency),
            setup.truck.geometry),
        station_(drive.station),
        tunnel_(static_cast<std::uint32_t>(plan.seed)),
        keep_every_(keep_every) {
    simulation::Random random(plan.seed, simulation::Stream::kScene);
    speed_ = random.uniform(habit.speed_min, habit.speed_max);
  }

  HumanDrive run() {
    simulator_.place(simulator_.poseOnLine(station_, 0.0, 0.0));
    const double end = simulator_.world().design_line.length() - kOpenEnd;
    while (simulator_.truth().station < end && toSeconds(simulator_.now()) < kTimeLimit) step();
    HumanDrive result;
    result.metrics = simulation::driveMetrics(track_, simulator_.world().design_line);
    result.metrics["contacts"] = static_cast<double>(simulator_.truth().contacts);
    result.inside_heading = insideHeading();
    result.lessons = std::move(lessons_);
    return result;
  }

 private:
  static world::World simulation_world(const DriveExperiment& drive,
                                       const simulation::EpisodePlan& plan) {
    world::World world = world::loadWorld(drive.world_file, {plan.seed, plan.reversed});
    if (world.design_line.empty() || world.design_line.closed()) {
      throw std::invalid_argument(drive.world_file + ": the human drives along open design lines");
    }
    return world;
  }

  void step() {
    const Simulator::Events& events = simulator_.step();
    const Stamp now = simulator_.now();
    if (events.scan != nullptr) takeScan(*events.scan, now);
    if (now >= next_tick_) takeMotion(now);
    if (now >= next_look_ && toSeconds(now) > kWaits) {
      next_look_ = now + fromSeconds(kLook);
      demand_ = human_.steer(simulator_.truth(), bridge_.motion(), now);
    }
    const double missing = toSeconds(now) > kWaits ? speed_ - simulator_.state().speed : 0.0;
    simulator_.lead(vehicle::PlantInput{demand_, kSpeedGain * missing});
    if (events.truth && toSeconds(now) > kWaits) record();
  }

  void takeMotion(Stamp now) {
    next_tick_ = now + fromSeconds(1.0 / simulation::Pilot::kTickRate);
    bridge_.tick(now);
    if (!bridge_.motionFresh(now)) return;
    history_.add(bridge_.motion(), now);
    demonstration_.addMotion(bridge_.motion());
    for (Lesson& lesson : demonstration_.take()) {
      if (count_++ % keep_every_ == 0) lessons_.push_back(std::move(lesson));
    }
  }

  void takeScan(const geometry::Scan& scan, Stamp now) {
    const perception::Tunnel* tunnel =
        perception_.update(scan, sensor_, history_.poseAt(scan.stamp), now);
    if (tunnel == nullptr) return;
    std::optional<double> offset;
    if (tunnel->state.valid) offset = tunnel->state.lateral_offset;
    demonstration_.addScan(perception_.filtered().network_scan, offset, tunnel_);
  }

  void record() {
    const simulation::Truth& truth = simulator_.truth();
    simulation::TrackSample sample;
    sample.time = toSeconds(truth.stamp);
    sample.front = truth.state.pose;
    sample.articulation = truth.state.articulation;
    sample.articulation_command = simulator_.articulationCommand();
    sample.speed = truth.state.speed;
    sample.yaw_rate = truth.state.yaw_rate;
    sample.station = truth.station;
    sample.lateral_offset = truth.lateral_offset;
    sample.heading_error = truth.heading_error;
    sample.curvature = truth.curvature;
    sample.clearance = truth.clearance;
    track_.push_back(sample);
  }

  double insideHeading() const {
    double sum = 0.0;
    std::size_t count = 0;
    for (const simulation::TrackSample& sample : track_) {
      if (std::abs(sample.curvature) < kStraight) continue;
      sum += std::copysign(1.0, sample.curvature) * sample.heading_error;
      ++count;
    }
    return count == 0 ? 0.0 : sum / static_cast<double>(count);
  }

  can::MemoryBusHub hub_;
  std::unique_ptr<can::Bus> truck_side_;
  std::unique_ptr<can::Bus> pilot_side_;
  Simulator simulator_;
  bridge::CanBridge bridge_;
  simulation::PerceptionChain perception_;
  geometry::Pose sensor_;
  geometry::Path line_;
  HumanDriver human_;
  Demonstration demonstration_;
  drivers::MotionHistory history_;
  double station_;
  std::uint32_t tunnel_;
  int keep_every_;
  double speed_ = 0.0;
  double demand_ = 0.0;
  Stamp next_tick_{};
  Stamp next_look_{};
  int count_ = 0;
  std::vector<Lesson> lessons_;
  std::vector<simulation::TrackSample> track_;
};

}  // namespace

HumanDrive driveAsHuman(const simulation::Scenario& scenario, const simulation::Setup& setup,
                        const simulation::EpisodePlan& plan, const HumanHabit& habit, int keep_every) {
  const auto* drive = std::get_if<DriveExperiment>(&scenario.experiment);
  if (drive == nullptr) throw std::invalid_argument(scenario.file + ": not a drive");
  return Recording(*drive, scenario, setup, plan, habit, keep_every).run();
}

namespace {

constexpr double kBin = 0.1;         // [m]
constexpr float kInBend = 0.05F;     // articulation that tells a bend [rad]
constexpr double kLeastKept = 0.15;  // of lessons far inside that stay: they teach to come back

// Offset to the inside of the bend, in bins; on straights all are in the middle one.
int binOf(const Lesson& lesson) {
  if (std::abs(lesson.example.label) < kInBend) return 0;
  const float inside = std::copysign(1.0F, lesson.example.label) * lesson.offset;
  return static_cast<int>(std::lround(static_cast<double>(inside) / kBin));
}

}  // namespace

DataSet examplesOf(const std::vector<Lesson>& lessons, bool corrected) {
  DataSet examples;
  if (!corrected) {
    for (const Lesson& lesson : lessons) examples.push_back(lesson.example);
    return examples;
  }
  std::map<int, double> count, credit;
  for (const Lesson& lesson : lessons) {
    if (lesson.correction) count[binOf(lesson)] += 1.0;
  }
  for (const Lesson& lesson : lessons) {
    if (!lesson.correction) continue;
    const int bin = binOf(lesson);
    const double share = std::max(count[-bin] / count[bin], kLeastKept);
    credit[bin] += std::min(1.0, share);
    if (credit[bin] < 1.0) continue;
    credit[bin] -= 1.0;
    examples.push_back(lesson.example);
    examples.back().label += *lesson.correction;
  }
  return examples;
}

double InsideReport::mean() const {
  double sum = 0.0;
  for (const double value : inside) sum += value;
  return inside.empty() ? 0.0 : sum / static_cast<double>(inside.size());
}

namespace {

constexpr double kDegreesPerRadian = 57.29577951308232;

InsideReport letDrive(const simulation::Scenario& scenario, simulation::Setup setup,
                      const neural::NetworkFile& network, int seeds, int jobs) {
  setup.pilot.driver = simulation::DriverChoice::kLidarDriver;
  setup.pilot.network = std::make_shared<neural::NetworkFile>(network);
  InsideReport report;
  const auto plans = simulation::episodePlans(scenario, seeds);
  for (const auto& result : simulation::runEpisodes(scenario, setup, plans, jobs, [](std::size_t) {})) {
    ++report.drives;
    report.completed += result.metrics.at("completed") > 0.0 ? 1 : 0;
    const auto inside = result.metrics.find("inside_mean");
    if (inside != result.metrics.end()) report.inside.push_back(inside->second);
  }
  return report;
}

std::string told(const char* who, const InsideReport& report) {
  char line[160];
  std::snprintf(line, sizeof line, "%s: %.1f mm inside of bends, %d of %d drives completed", who,
                1e3 * report.mean(), report.completed, report.drives);
  return line;
}

}  // namespace

HumanReport humanExperiment(const simulation::Scenario& scenario, const simulation::Setup& setup,
                            const HumanOptions& options, const Recipe& recipe, int jobs,
                            const std::function<void(const std::string&)>& tell) {
  simulation::Scenario his = scenario;
  his.first_seed = options.first_seed;
  const auto plans = simulation::episodePlans(his, options.tunnels);
  std::vector<HumanDrive> drives(plans.size());
  inParallel(plans.size(), jobs, [&](std::size_t i) {
    drives[i] = driveAsHuman(scenario, setup, plans[i], options.habit, options.keep_every);
  });
  HumanReport report;
  std::vector<Lesson> lessons;
  for (HumanDrive& drive : drives) {
    report.human.inside.push_back(drive.metrics.at("inside_mean"));
    ++report.human.drives;
    report.human.completed += drive.metrics.at("contacts") > 0.0 ? 0 : 1;
    report.human_heading += drive.inside_heading / static_cast<double>(drives.size());
    std::move(drive.lessons.begin(), drive.lessons.end(), std::back_inserter(lessons));
  }
  tell(told("human", report.human) + ", heading " +
       std::to_string(kDegreesPerRadian * report.human_heading) + " deg");
  const auto taught = [&](bool corrected) {
    const DataSet data = examplesOf(lessons, corrected);
    return follow(recipe, &data, jobs, tell);
  };
  report.raw_network = taught(false);
  report.raw = letDrive(scenario, setup, *report.raw_network, options.evaluated, jobs);
  tell(told("network on his labels", report.raw));
  report.corrected_network = taught(true);
  report.corrected = letDrive(scenario, setup, *report.corrected_network, options.evaluated, jobs);
  tell(told("network on corrected labels", report.corrected));
  return report;
}

}  // namespace tunnel_pilot::learning
