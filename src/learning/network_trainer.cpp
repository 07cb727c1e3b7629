#include "tunnel_pilot/learning/network_trainer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>

#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/learning/input_projection.h"
#include "tunnel_pilot/neural/adam.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

using neural::BatchPass;
constexpr std::size_t kLanes = BatchPass::kLanes;
constexpr std::size_t kGroups = 2;  // of kLanes examples in one step
constexpr double kLeastProbability = 1e-9;

struct Loss {
  double entropy = 0.0;
  double squares = 0.0;
  std::size_t count = 0;
};

// The inputs of examples, one column each, or of their mirror images.
Eigen::MatrixXf inputsOf(const neural::NetworkFile& file, const DataSet& examples, bool mirrored) {
  drivers::LidarInputs inputs(file.inputs, file.name);
  Eigen::MatrixXf columns(static_cast<Eigen::Index>(inputs.size()),
                          static_cast<Eigen::Index>(examples.size()));
  for (std::size_t i = 0; i < examples.size(); ++i) {
    float* column = columns.col(static_cast<Eigen::Index>(i)).data();
    if (!inputs.fill(examples[i].ranges, truckInputsOf(examples[i]), column)) {
      throw std::runtime_error("an example without usable ranges");
    }
    if (mirrored) inputs.fillMirrored(column);
  }
  return columns;
}

// One thread's share of a step: kLanes examples through the network and back.
class Worker {
 public:
  Worker(const neural::Network& network, const neural::NetworkFile& file, double decode_weight)
      : pass_(network),
        code_(file.network.outputs(), file.output.first, file.output.spacing, file.output.width),
        decode_weight_(decode_weight),
        targets_(file.network.outputs()),
        outputs_(file.network.outputs()),
        derivatives_(file.network.outputs()),
        spacing_(file.output.spacing),
        gradient_(network.parameters().size()) {}

  void load(std::size_t lane, const float* inputs, std::size_t count, double label) {
    for (std::size_t i = 0; i < count; ++i) pass_.input(i)[lane] = static_cast<double>(inputs[i]);
    labels_[lane] = label;
  }

  // Loss of the first `count` lanes; with `learn`, their gradient is added up.
  Loss run(std::size_t count, bool learn) {
    pass_.forward();
    Loss loss;
    loss.count = count;
    if (learn) std::fill(gradient_.begin(), gradient_.end(), 0.0);
    for (std::size_t o = 0; o < targets_.size(); ++o)
      std::fill_n(pass_.outputGradient(o), kLanes, 0.0);
    for (std::size_t lane = 0; lane < count; ++lane) judge(lane, loss);
    if (learn) pass_.backward(gradient_);
    return loss;
  }

  const std::vector<double>& gradient() const { return gradient_; }

 private:
  void judge(std::size_t lane, Loss& loss) {
    code_.encode(labels_[lane], targets_.data());
    for (std::size_t o = 0; o < targets_.size(); ++o) {
      const double y = std::clamp(pass_.output(o)[lane], kLeastProbability, 1.0 - kLeastProbability);
      const double t = targets_[o];
      outputs_[o] = y;
      const double floor = t > 0.0 && t < 1.0 ? t * std::log(t) + (1.0 - t) * std::log(1.0 - t) : 0.0;
      loss.entropy += floor - t * std::log(y) - (1.0 - t) * std::log(1.0 - y);
      pass_.outputGradient(o)[lane] = (y - t) / (y * (1.0 - y));
    }
    const double error = code_.decode(outputs_.data(), derivatives_.data()) - labels_[lane];
    loss.squares += error * error;
    const double pull = decode_weight_ * error / (spacing_ * spacing_);
    for (std::size_t o = 0; o < targets_.size(); ++o) pass_.outputGradient(o)[lane] += pull * derivatives_[o];
  }

  BatchPass pass_;
  neural::GaussianCode code_;
  double decode_weight_;
  std::vector<double> targets_;
  std::vector<double> outputs_, derivatives_;
  double spacing_;
  std::array<double, kLanes> labels_{};
  std::vector<double> gradient_;
};

class Barrier {
 public:
  explicit Barrier(int count) : count_(count), waiting_(count) {}
  void wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    const int round = round_;
    if (--waiting_ == 0) {
      waiting_ = count_;
      ++round_;
      ready_.notify_all();
    } else {
      ready_.wait(lock, [&] { return round_ != round; });
    }
  }

 private:
  int count_, waiting_;
  int round_ = 0;
  std::mutex mutex_;
  std::condition_variable ready_;
};

}  // namespace

void trainNetwork(neural::NetworkFile& file, const DataSet& examples, const DataSet& validation,
                  const TrainingOptions& options,
                  const std::function<void(const TrainingProgress&)>& progress) {
  Eigen::MatrixXf plain = inputsOf(file, examples, false);
  Eigen::MatrixXf mirror = inputsOf(file, examples, true);
  Eigen::MatrixXf checked = inputsOf(file, validation, false);
  std::optional<InputProjection> projection;
  std::optional<neural::Network> inner;
  if (file.network.layers().front().kind == neural::Layer::Kind::kDense && options.components > 0) {
    const Eigen::Index few = std::min<Eigen::Index>(plain.cols(), 20000);
    Eigen::MatrixXf sample(plain.rows(), 2 * few);  // spread over all, both ways round
    for (Eigen::Index i = 0; i < few; ++i) {
      sample.col(2 * i) = plain.col(i * plain.cols() / few);
      sample.col(2 * i + 1) = mirror.col(i * plain.cols() / few);
    }
    projection.emplace(sample, drivers::LidarInputs::kBeams, options.components);
    plain = projection->project(plain);
    mirror = projection->project(mirror);
    checked = projection->project(checked);
    std::vector<neural::Layer> layers = file.network.layers();
    layers.front() = neural::Layer::dense(projection->size(), layers.front().channels_out, layers.front().activation);
    inner.emplace(layers);
    inner->randomise(options.seed);
  }
  neural::Network& network = inner ? *inner : file.network;
  const auto rows = static_cast<std::size_t>(plain.rows());
  std::vector<Worker> workers;
  for (std::size_t i = 0; i < kGroups; ++i) workers.emplace_back(network, file, options.decode_weight);
  auto& parameters = network.parameters();
  const std::vector<double> initial = parameters;
  std::vector<double> best = parameters;
  double best_error = std::numeric_limits<double>::infinity();
  neural::Adam adam(parameters.size(), {options.rate, 0.9, 0.999, 1e-8, options.weight_decay});
  simulation::Random random(options.seed, simulation::Stream::kTraining);
  std::vector<std::uint32_t> order(examples.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::uint32_t>(i);
  std::vector<std::uint8_t> mirrored(order.size());
  const std::size_t batch = kGroups * kLanes;
  const std::size_t steps = examples.size() / batch;
  const auto total = static_cast<double>(steps * static_cast<std::size_t>(options.epochs));
  std::vector<double> gradient(parameters.size());

  const auto runGroups = [&](const auto& work) {  // each group on a thread of its own
    if (options.threads < 2) {
      for (std::size_t g = 0; g < kGroups; ++g) work(g);
      return;
    }
    std::vector<std::thread> threads;
    for (std::size_t g = 1; g < kGroups; ++g) threads.emplace_back([&work, g] { work(g); });
    work(0);
    for (auto& thread : threads) thread.join();
  };

  std::size_t done = 0;
  for (int epoch = 1; epoch <= options.epochs; ++epoch) {
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[static_cast<std::size_t>(random.uniform() * static_cast<double>(i))]);
    }
    for (auto& m : mirrored) m = options.mirror && random.uniform() < 0.5 ? 1 : 0;
    std::array<Loss, kGroups> losses{};
    Barrier begin(kGroups), end(kGroups);
    runGroups([&](std::size_t g) {
      for (std::size_t s = 0; s < steps; ++s) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
          const std::size_t at = s * batch + g * kLanes + lane;
          const bool m = mirrored[at] != 0;
          const double label = static_cast<double>(examples[order[at]].label);
          workers[g].load(lane, (m ? mirror : plain).col(order[at]).data(), rows, m ? -label : label);
        }
        const Loss loss = workers[g].run(kLanes, true);
        losses[g].entropy += loss.entropy;
        losses[g].count += loss.count;
        begin.wait();
        if (g == 0) {
          for (std::size_t i = 0; i < gradient.size(); ++i) {
            gradient[i] = 0.0;
            for (const Worker& worker : workers) gradient[i] += worker.gradient()[i];
            gradient[i] /= static_cast<double>(batch);
          }
          const double share = static_cast<double>(done++) / total;
          adam.step(parameters, gradient, 0.01 + 0.99 * 0.5 * (1.0 + std::cos(M_PI * share)));
        }
        end.wait();
      }
    });
    Loss train;
    for (const Loss& l : losses) train.entropy += l.entropy, train.count += l.count;
    std::array<Loss, kGroups> checks{};
    runGroups([&](std::size_t g) {
      for (std::size_t first = g * kLanes; first < validation.size(); first += batch) {
        const std::size_t count = std::min(kLanes, validation.size() - first);
        for (std::size_t lane = 0; lane < count; ++lane) workers[g].load(lane, checked.col(static_cast<Eigen::Index>(first + lane)).data(), rows, static_cast<double>(validation[first + lane].label));
        const Loss loss = workers[g].run(count, false);
        checks[g].entropy += loss.entropy, checks[g].squares += loss.squares, checks[g].count += loss.count;
      }
    });
    Loss check;
    for (const Loss& l : checks) check.entropy += l.entropy, check.squares += l.squares, check.count += l.count;
    const TrainingProgress now{epoch, train.entropy / static_cast<double>(train.count),
                               check.entropy / static_cast<double>(check.count),
                               std::sqrt(check.squares / static_cast<double>(check.count))};
    if (!std::isfinite(now.loss) || !std::isfinite(now.validation_loss)) {
      parameters = initial;
      throw std::runtime_error("training diverged in epoch " + std::to_string(epoch));
    }
    if (now.validation_loss < best_error) {
      best_error = now.validation_loss;
      best = parameters;
    }
    progress(now);
  }
  parameters = best;
  if (inner) projection->unfold(*inner, file.network);
}

}  // namespace tunnel_pilot::learning
