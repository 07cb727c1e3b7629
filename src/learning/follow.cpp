#include <cmath>
#include <cstdio>
#include <map>
#include <memory>

#include "in_parallel.h"
#include "tunnel_pilot/config/sha256.h"
#include "tunnel_pilot/drivers/inverse_ranges.h"
#include "tunnel_pilot/drivers/scan_domain.h"
#include "tunnel_pilot/learning/drive_collector.h"
#include "tunnel_pilot/learning/recipe.h"
#include "tunnel_pilot/simulation/fingerprint.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

constexpr std::uint64_t kSeedsOfASource = 1000;
constexpr double kDegrees = 57.29577951308232;
constexpr std::uint32_t kHeldOutShare = 5;  // of data from files, every so many tunnels

void moveInto(DataSet& to, DataSet from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

template <typename... Values>
std::string text(const char* format, Values... values) {
  char line[256];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

class Cook {
 public:
  Cook(const Recipe& recipe, int jobs, const std::function<void(const std::string&)>& tell)
      : recipe_(recipe),
        jobs_(jobs),
        tell_(tell),
        setup_(simulation::loadSetup(simulation::loadScenario(recipe.base_scenario))),
        file_(makeNetwork(recipe.design, recipe.name)) {
    file_.network.randomise(recipe.seed);
    setup_.pilot.driver = simulation::DriverChoice::kLidarDriver;
    // An unsure beginner shall go on, to be shown better.
    for (supervision::SourceRule& rule : setup_.pilot.arbiter.sources) rule.min_confidence = 0.0;
    // A network that is not told of a slow steering can make nothing of labels that are for one.
    if (recipe.design.truck == NetworkDesign::Truck::kAll) return;
    for (SceneSource& source : recipe_.scenes) source.spread.slower = 0.0;
    setup_.pilot.lidar_driver.steering.rate_change = 0.0;
  }

  neural::NetworkFile run(const DataSet* data) {
    if (data != nullptr) {
      split(*data);
      train(recipe_.training);
    } else {
      sample();
      for (int round = 0; round < recipe_.rounds; ++round) {
        TrainingOptions options = recipe_.training;
        options.epochs = recipe_.epochs_between;
        train(options);
        drive(round);
      }
      train(recipe_.training);
    }
    file_.domain = domain();
    file_.training = record(data != nullptr);
    return std::move(file_);
  }

 private:
  // Every fifth of the tunnels that there are is held out, and one at least.
  void split(const DataSet& data) {
    std::map<std::uint32_t, std::uint32_t> order;
    for (const Example& example : data) order.emplace(example.tunnel, 0);
    if (order.size() < 2) {
      throw config::ConfigError(
          "the recorded drives are all of one tunnel: some must be held out. Extract several bags, or "
          "one "
          "with --tunnel-length");
    }
    std::uint32_t next = 0;
    for (auto& [tunnel, number] : order) number = next++;
    for (const Example& example : data) {
      (order.at(example.tunnel) % kHeldOutShare == 0 ? held_out_ : examples_).push_back(example);
    }
    tell_(text("%zu examples, %zu more held out", examples_.size(), held_out_.size()));
  }

  void sample() {
    for (std::size_t s = 0; s < recipe_.scenes.size(); ++s) {
      const SceneSource& source = recipe_.scenes[s];
      const auto all =
          static_cast<std::size_t>(source.tunnels) + static_cast<std::size_t>(recipe_.held_out);
      std::vector<DataSet> sets(all);
      inParallel(all, jobs_, [&](std::size_t i) {
        const std::uint64_t seed = recipe_.seed + kSeedsOfASource * s + i;
        sets[i] = sampleScenes(source.world_file, seed, source.examples, setup_, recipe_.teacher,
                               source.spread);
      });
      for (std::size_t i = 0; i < all; ++i) {
        moveInto(i < static_cast<std::size_t>(source.tunnels) ? examples_ : held_out_,
                 std::move(sets[i]));
      }
    }
    tell_(text("%zu scenes, %zu more held out", examples_.size(), held_out_.size()));
  }

  void train(const TrainingOptions& options) {
    trainNetwork(file_, examples_, held_out_, options, [&](const TrainingProgress& now) {
      tell_(text("epoch %3d of %d: loss %.4f, held out %.4f, angle off by %.3f deg RMS", now.epoch,
                 options.epochs, now.loss, now.validation_loss, kDegrees * now.validation_rms));
      last_ = now;
    });
  }

  void drive(int round) {
    setup_.pilot.network = std::make_shared<neural::NetworkFile>(file_);
    for (std::size_t s = 0; s < recipe_.drives.size(); ++s) driveSource(recipe_.drives[s], s, round);
    tell_(text("round %d of drives: %zu examples, %zu more held out", round + 1, examples_.size(),
               held_out_.size()));
  }

  void driveSource(const DriveSource& source, std::size_t number, int round) {
    const simulation::Scenario scenario = simulation::loadScenario(source.scenario_file);
    const std::uint64_t first = recipe_.seed + kSeedsOfASource * recipe_.scenes.size() +
                                100 * (number + recipe_.drives.size() * static_cast<std::size_t>(round));
    simulation::Scenario seeded = scenario;
    seeded.first_seed = first;
    const std::vector<simulation::EpisodePlan> plans = simulation::episodePlans(seeded, source.tunnels);
    std::vector<DataSet> sets(plans.size());
    inParallel(plans.size(), jobs_, [&](std::size_t i) {
      DriveCollector collector(setup_, recipe_.teacher, static_cast<std::uint32_t>(plans[i].seed));
      simulation::runEpisode(varied(scenario, source, plans[i].seed), setup_, plans[i], &collector);
      sets[i] = collector.take();
    });
    // The last tunnels of each round are held out.
    const std::uint64_t held_out_from = first + static_cast<std::uint64_t>(source.tunnels) - 1;
    for (std::size_t i = 0; i < plans.size(); ++i) {
      moveInto(plans[i].seed >= held_out_from ? held_out_ : examples_, std::move(sets[i]));
    }
  }

  static simulation::Scenario varied(simulation::Scenario scenario, const DriveSource& source,
                                     std::uint64_t seed) {
    auto* drive = std::get_if<simulation::DriveExperiment>(&scenario.experiment);
    if (drive == nullptr)
      throw config::ConfigError(scenario.file + ": is no drive, nothing is learned from it");
    scenario.plant.variation = source.variation;
    simulation::Random random(seed, simulation::Stream::kTraining);
    drive->top_speed = random.uniform(source.speed_min, source.speed_max);
    if (drive->rolling_speed > 0.0) {
      drive->rolling_speed = drive->top_speed;
      drive->lateral_offset = random.uniform(-source.offset, source.offset);
      drive->heading_error = random.uniform(-source.heading, source.heading);
    }
    return scenario;
  }

  neural::InputDomain domain() const {
    std::vector<drivers::ScanDomain::Features> features;
    std::vector<float> inverse(drivers::LidarInputs::kBeams);
    for (std::size_t i = 0; i < examples_.size();
         i += std::max<std::size_t>(1, examples_.size() / 50'000)) {
      if (drivers::invertRanges(examples_[i].ranges, inverse)) {
        features.push_back(drivers::ScanDomain::features(inverse));
      }
    }
    return drivers::ScanDomain::fit(features);
  }

  std::string record(bool from_files) const {
    std::string words =
        "recipe " + recipe_.name + " (SHA-256 " + simulation::sha256OfFiles({recipe_.file}) + ")";
    words += from_files ? ", from recorded drives\n"
                        : text(", seed %llu, %d rounds of drives\n",
                               static_cast<unsigned long long>(recipe_.seed), recipe_.rounds);
    words += text("%zu examples, %zu of tunnels held out\n", examples_.size(), held_out_.size());
    words += text("last epoch: loss %.4f, held out %.4f, angle off by %.3f deg RMS\n", last_.loss,
                  last_.validation_loss, kDegrees * last_.validation_rms);
    return words;
  }

  Recipe recipe_;
  int jobs_;
  std::function<void(const std::string&)> tell_;
  simulation::Setup setup_;
  neural::NetworkFile file_;
  DataSet examples_;
  DataSet held_out_;
  TrainingProgress last_{};
};

}  // namespace

neural::NetworkFile follow(const Recipe& recipe, const DataSet* data, int jobs,
                           const std::function<void(const std::string&)>& tell) {
  return Cook(recipe, jobs, tell).run(data);
}

}  // namespace tunnel_pilot::learning
