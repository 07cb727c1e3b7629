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
// f_e, y'', y', y. Farther from the path than its range, the truck comes back no harder: it could not
// turn out of it again in time, for its hinge turns slowly.
constexpr drivers::PreviewInputs kRange{2.5, 2.5, 2.0, 0.12};
constexpr double kOutputScale = 0.5;  // [rad]
// Standard deviations of the imitated situations, of their ranges: half usual ones, half hard ones.
using Spread = std::array<double, PreviewNetwork::kInputs>;
constexpr Spread kUsualSpread = {0.1, 0.15, 0.1, 0.5};
constexpr Spread kWideSpread = {0.3, 0.35, 0.3, 0.8};
constexpr double kImitationRate = 0.01;
// The preview law; found on drives with training seeds.
constexpr int kLawPasses = 3;
constexpr double kDamping = 1.2;           // of lateral speed against the pure least mean square
constexpr double kForesight = 0.1;         // of the error that the present lateral acceleration leads to
constexpr double kRateShare = 0.5;         // of the time to turn the hinge that counts as delay
constexpr double kUsualTurning = 0.3;      // that the correction makes up for [s]
constexpr double kLongestTurning = 5.0;    // [s]
constexpr double kMostArticulation = 0.8;  // [rad]
constexpr double kCostPower = 4.0;         // the goal is one for the worst drive

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
    plans.reserve(static_cast<std::size_t>(options.validation_drives));
    for (int i = 0; i < options.validation_drives; ++i) {
      plans.push_back({options.validation_seed + static_cast<std::uint64_t>(i), false});
    }
    const auto episodes =
        simulation::runEpisodes(course.scenario, course.setup, plans, options.jobs, [](std::size_t) {});
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

double previewLaw(const PreviewTruck& truck, const drivers::PreviewInputs& in) {
  constexpr double kSpeed = drivers::NeuralPreviewDriver::kNetworkSpeed;
  const double constant = truck.wheelbase / (kSpeed * kSpeed);  // C_0
  const double horizon = truck.preview_time;
  const double square = horizon * horizon;
  const double of_path = 2.0 * in.road_preview / square;
  double speed = in.lateral_speed;
  double wanted = 0.0;
  for (int pass = 0; pass < kLawPasses; ++pass) {
    const double error = in.road_preview - 5.0 / 3.0 * in.lateral_position -
                         kDamping * 1.25 * horizon * speed +
                         kForesight * (in.road_preview - 0.5 * square * in.lateral_acceleration);
    wanted = 2.0 * error / square;
    const double turning = std::abs(constant * (wanted - in.lateral_acceleration)) / truck.max_rate;
    const double late = kRateShare * std::clamp(turning - kUsualTurning, 0.0, kLongestTurning);
    speed = in.lateral_speed + 0.5 * late * (in.lateral_acceleration - of_path);
  }
  return std::clamp(constant * wanted, -kMostArticulation, kMostArticulation);
}

NetworkFile imitatePreviewLaw(const PreviewTruck& truck, std::uint64_t seed, int steps) {
  NetworkFile file = emptyNetwork();
  file.network.randomise(seed);
  simulation::Random random(seed, simulation::Stream::kTraining);
  neural::AdamParameters settings;
  settings.rate = kImitationRate;
  neural::Adam adam(file.network.parameters().size(), settings);
  neural::BatchPass pass(file.network);
  std::vector<double> gradient(file.network.parameters().size());
  std::array<double, neural::BatchPass::kLanes> targets{};
  for (int step = 0; step < steps; ++step) {
    for (std::size_t lane = 0; lane < targets.size(); ++lane) {
      const Spread& spread = lane % 2 == 0 ? kUsualSpread : kWideSpread;
      std::array<double, PreviewNetwork::kInputs> x{};
      for (std::size_t i = 0; i < x.size(); ++i) {
        pass.input(i)[lane] = x[i] = std::clamp(spread[i] * random.normal(), -1.0, 1.0);
      }
      targets[lane] = previewLaw(truck, {kRange.road_preview * x[0], kRange.lateral_acceleration * x[1],
                                         kRange.lateral_speed * x[2], kRange.lateral_position * x[3]}) /
                      kOutputScale;
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
  const vehicle::TruckGeometry& geometry = courses.front().setup.truck.geometry;
  const drivers::PreviewDriverParameters& driver = courses.front().setup.pilot.preview_driver;
  const PreviewTruck truck{geometry.front_axle_to_hinge + geometry.rear_axle_to_hinge,
                           driver.truck.steering.max_rate, driver.preview_time};
  NetworkFile network = imitatePreviewLaw(truck, options.seed, options.imitation_steps);
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
