#include "tunnel_pilot/learning/preview_training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "tunnel_pilot/drivers/neural_preview_driver.h"
#include "tunnel_pilot/neural/adam.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/loss.h"
#include "tunnel_pilot/simulation/episode.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

using drivers::PreviewNetwork;
using neural::Activation;
using neural::Layer;
using neural::NetworkFile;

constexpr double kPi = 3.141592653589793;
constexpr drivers::PreviewInputs kRange{2.5, 2.5, 2.0, 2.0};  // f_e, y'', y', y of hard driving
constexpr double kOutputScale = 0.5;                          // [rad]
constexpr double kSpread = 0.35;     // standard deviation of the imitated situations, of their range
constexpr double kImitationRate = 0.01;
constexpr double kCostPower = 4.0;   // the goal is one for the worst drive

// One lane change with what it takes to drive it.
struct Course {
  simulation::Scenario scenario;
  simulation::Setup setup;
  double goal;  // of the largest path error [m]
};

Course loadCourse(const std::string& file) {
  Course course{simulation::loadScenario(file), {}, 0.0};
  const bool lane_change =
      std::holds_alternative<simulation::LaneChangeExperiment>(course.scenario.experiment);
  for (const simulation::Goal& goal : course.scenario.goals) {
    if (goal.metric == "path_error_max" && goal.max) course.goal = *goal.max;
  }
  if (!lane_change || !(course.goal > 0.0)) {
    throw config::ConfigError(file + ": is no lane change with a goal for path_error_max to train on");
  }
  course.setup = simulation::loadSetup(course.scenario);
  return course;
}

// The driver that steers by this network; learning while it drives, if wanted.
void give(Course& course, const NetworkFile& network, const drivers::AdaptationParameters& adaptation) {
  drivers::PreviewDriverParameters& driver = course.setup.pilot.preview_driver;
  driver.law = drivers::PreviewLaw::kNetwork;
  driver.network = std::make_shared<NetworkFile>(network);
  driver.network_law.adaptation = adaptation;
}

// Reads a driver's output weights after every scan.
class WeightReader : public simulation::DriveObserver {
 public:
  void afterScan(const simulation::Simulator&, const simulation::Pilot& pilot) override {
    const auto* driver = dynamic_cast<const drivers::NeuralPreviewDriver*>(pilot.previewDriver());
    if (driver == nullptr) return;
    last = driver->network().weights();
    for (std::size_t j = 0; j < last.size(); ++j) sum[j] += last[j];
    ++count;
  }
  void afterTruth(const simulation::Simulator&) override {}

  PreviewNetwork::Hidden last{};
  PreviewNetwork::Hidden sum{};
  int count = 0;
};

void setWeights(NetworkFile& network, const PreviewNetwork::Hidden& weights, double divisor) {
  const std::size_t first = network.network.layers().front().parameters();
  for (std::size_t j = 0; j < weights.size(); ++j) {
    network.network.parameters()[first + j] = weights[j] / divisor / network.output.scale;
  }
}

struct Judgement {
  double cost = 0.0;
  double worst = 0.0;
};

Judgement judge(std::vector<Course>& courses, const NetworkFile& network,
                const PreviewTrainingOptions& options) {
  Judgement judgement;
  for (Course& course : courses) {
    give(course, network, {false, 0.0, 0.0, 0.0});
    std::vector<simulation::EpisodePlan> plans;
    for (int i = 0; i < options.validation_drives; ++i) {
      plans.push_back({options.validation_seed + static_cast<std::uint64_t>(i), false});
    }
    const auto episodes = simulation::runEpisodes(course.scenario, course.setup, plans, options.jobs,
                                                  [](std::size_t) {});
    for (const simulation::EpisodeResult& episode : episodes) {
      const bool completed = episode.metrics.at("completed") == 1.0;
      const double error = completed ? episode.metrics.at("path_error_max") / course.goal
                                     : std::numeric_limits<double>::infinity();
      judgement.cost += std::pow(error, kCostPower);
      judgement.worst = std::max(judgement.worst, error);
    }
  }
  judgement.cost /= static_cast<double>(courses.size()) * options.validation_drives;
  return judgement;
}

// One round of drives by the online rule: every scenario in turn, each drive with a seed of its own.
void driveRound(std::vector<Course>& courses, NetworkFile& network, int round,
                const PreviewTrainingOptions& options) {
  const drivers::AdaptationParameters rule{true, options.rate, options.momentum, options.bound};
  std::uint64_t seed = options.first_seed + static_cast<std::uint64_t>(round * options.drives) *
                                                static_cast<std::uint64_t>(courses.size());
  WeightReader reader;
  for (int i = 0; i < options.drives; ++i) {
    for (Course& course : courses) {
      give(course, network, rule);
      simulation::runEpisode(course.scenario, course.setup, {seed++, false}, &reader);
      if (reader.count > 0) setWeights(network, reader.last, 1.0);
    }
  }
  if (reader.count > 0) setWeights(network, reader.sum, reader.count);
}

NetworkFile emptyNetwork() {
  NetworkFile file{"preview_driver",
                   neural::Network({Layer::dense(PreviewNetwork::kInputs, PreviewNetwork::kHidden,
                                                 Activation::kSigmoid),
                                    Layer::dense(PreviewNetwork::kHidden, 1, Activation::kLinear)}),
                   drivers::previewInputGroups(kRange),
                   {},
                   "",
                   ""};
  file.output.meaning = "articulation_angle";
  file.output.unit = "rad";
  file.output.scale = kOutputScale;
  return file;
}

// a_y* of the preview law [m/s^2].
double wantedAcceleration(const drivers::PreviewInputs& inputs, double preview_time) {
  return 2.0 *
         (inputs.road_preview - 5.0 / 3.0 * inputs.lateral_position -
          1.25 * preview_time * inputs.lateral_speed) /
         (preview_time * preview_time);
}

std::string record(const PreviewTrainingOptions& options, int kept, const Judgement& judgement) {
  return "imitation of the optimal preview law, " + std::to_string(options.imitation_steps) +
         " steps, seed " + std::to_string(options.seed) + "; then " + std::to_string(options.rounds) +
         " rounds of closed-loop drives by the online rule, " + std::to_string(options.drives) + " of " +
         std::to_string(options.scenarios.size()) + " scenarios each, seeds from " +
         std::to_string(options.first_seed) + " on; kept: round " + std::to_string(kept) +
         ", largest path error " + std::to_string(judgement.worst) + " of its goal on " +
         std::to_string(options.validation_drives) + " seeds from " +
         std::to_string(options.validation_seed) + " on";
}

}  // namespace

NetworkFile imitatePreviewLaw(double wheelbase, double preview_time, std::uint64_t seed, int steps) {
  NetworkFile file = emptyNetwork();
  file.network.randomise(seed);
  simulation::Random random(seed, simulation::Stream::kTraining);
  neural::AdamParameters settings;
  settings.rate = kImitationRate;
  neural::Adam adam(file.network.parameters().size(), settings);
  neural::BatchPass pass(file.network);
  std::vector<double> gradient(file.network.parameters().size());
  std::array<double, neural::BatchPass::kLanes> targets{};
  constexpr double kSpeed = drivers::NeuralPreviewDriver::kNetworkSpeed;
  const double constant = wheelbase / (kSpeed * kSpeed) / (kOutputScale);  // C_0 over the output's scale
  const auto draw = [&] { return std::clamp(kSpread * random.normal(), -1.0, 1.0); };
  for (int step = 0; step < steps; ++step) {
    for (std::size_t lane = 0; lane < targets.size(); ++lane) {
      std::array<double, PreviewNetwork::kInputs> x{};
      for (std::size_t i = 0; i < x.size(); ++i) pass.input(i)[lane] = x[i] = draw();
      targets[lane] = constant * wantedAcceleration({kRange.road_preview * x[0],
                                                     kRange.lateral_acceleration * x[1],
                                                     kRange.lateral_speed * x[2],
                                                     kRange.lateral_position * x[3]},
                                                    preview_time);
    }
    pass.forward();
    neural::halfSquaredError(pass.output(0), targets.data(), targets.size(), pass.outputGradient(0));
    std::fill(gradient.begin(), gradient.end(), 0.0);
    pass.backward(gradient);
    for (double& slope : gradient) slope /= static_cast<double>(targets.size());
    adam.step(file.network.parameters(), gradient, 0.5 + 0.5 * std::cos(kPi * step / steps));
  }
  return file;
}

NetworkFile trainPreviewNetwork(const PreviewTrainingOptions& options,
                                const std::function<void(const PreviewTrainingProgress&)>& progress) {
  if (options.scenarios.empty()) throw config::ConfigError("no lane changes were named to train on");
  std::vector<Course> courses;
  for (const std::string& file : options.scenarios) courses.push_back(loadCourse(file));
  const vehicle::TruckGeometry& truck = courses.front().setup.truck.geometry;
  NetworkFile network = imitatePreviewLaw(truck.front_axle_to_hinge + truck.rear_axle_to_hinge,
                                          courses.front().setup.pilot.preview_driver.preview_time,
                                          options.seed, options.imitation_steps);
  NetworkFile best = network;
  Judgement least = judge(courses, best, options);
  int kept = 0;
  progress({0, least.cost, least.worst, true});
  for (int round = 1; round <= options.rounds; ++round) {
    driveRound(courses, network, round - 1, options);
    const Judgement judgement = judge(courses, network, options);
    const bool better = judgement.cost < least.cost;
    if (better) {
      best = network;
      least = judgement;
      kept = round;
    }
    progress({round, judgement.cost, judgement.worst, better});
  }
  best.training = record(options, kept, least);
  return best;
}

}  // namespace tunnel_pilot::learning
