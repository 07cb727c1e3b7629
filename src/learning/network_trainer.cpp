#include "tunnel_pilot/learning/network_trainer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <functional>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "barrier.h"
#include "tunnel_pilot/drivers/lidar_driver.h"
#include "tunnel_pilot/learning/input_projection.h"
#include "tunnel_pilot/neural/adam.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/early_stopping.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/loss.h"
#include "tunnel_pilot/simulation/random.h"

namespace tunnel_pilot::learning {
namespace {

using Eigen::Index;
using neural::BatchPass;

constexpr std::size_t kLanes = BatchPass::kLanes;
constexpr std::size_t kThreads = 2;  // each takes kLanes examples of a step
constexpr std::size_t kBatch = kThreads * kLanes;
constexpr Index kProjectedAtOnce = 4096;      // examples
constexpr Index kProjectionExamples = 20000;  // that the components are found from, and as many mirrored
constexpr double kLastRate = 0.01;            // share of the first one

struct Error {
  double loss = 0.0;
  double squares = 0.0;  // [rad^2]
  std::size_t count = 0;

  void add(const Error& other) {
    loss += other.loss;
    squares += other.squares;
    count += other.count;
  }
  double meanLoss() const { return loss / static_cast<double>(std::max<std::size_t>(count, 1)); }
  double rms() const {
    return std::sqrt(squares / static_cast<double>(std::max<std::size_t>(count, 1)));
  }
};

// Raw inputs of examples [first, last), one column each, or of their mirror images.
Eigen::MatrixXf rawInputs(const neural::NetworkFile& file, const DataSet& examples, Index first,
                          Index last, Index step, bool mirrored) {
  drivers::LidarInputs inputs(file.inputs, file.name);
  Eigen::MatrixXf columns(static_cast<Index>(inputs.size()), (last - first + step - 1) / step);
  for (Index i = first, column = 0; i < last; i += step, ++column) {
    const Example& example = examples[static_cast<std::size_t>(i)];
    float* values = columns.col(column).data();
    if (!inputs.fill(example.ranges, truckInputsOf(example), values)) {
      throw std::invalid_argument("example " + std::to_string(i) + " has no usable ranges");
    }
    if (mirrored) inputs.fillMirrored(values);
  }
  return columns;
}

// Inputs as the trained network takes them, piece by piece: the raw ones of all would fill the memory.
Eigen::MatrixXf inputsOf(const neural::NetworkFile& file, const DataSet& examples,
                         const std::optional<InputProjection>& projection, bool mirrored) {
  const auto count = static_cast<Index>(examples.size());
  if (!projection) return rawInputs(file, examples, 0, count, 1, mirrored);
  Eigen::MatrixXf columns(static_cast<Index>(projection->size()), count);
  for (Index first = 0; first < count; first += kProjectedAtOnce) {
    const Index last = std::min(first + kProjectedAtOnce, count);
    columns.middleCols(first, last - first) =
        projection->project(rawInputs(file, examples, first, last, 1, mirrored));
  }
  return columns;
}

// From examples spread over all, both ways round.
InputProjection projectionOf(const neural::NetworkFile& file, const DataSet& examples,
                             std::size_t components) {
  const auto count = static_cast<Index>(examples.size());
  const Index step = std::max<Index>(1, count / kProjectionExamples);
  const Eigen::MatrixXf plain = rawInputs(file, examples, 0, count, step, false);
  const Eigen::MatrixXf mirrored = rawInputs(file, examples, 0, count, step, true);
  Eigen::MatrixXf both(plain.rows(), plain.cols() + mirrored.cols());
  both << plain, mirrored;
  return {both, drivers::LidarInputs::kBeams, components};
}

// One thread's share of a step: kLanes examples through the network and back.
class Worker {
 public:
  Worker(const neural::Network& network, const neural::OutputGroup& output)
      : pass_(network),
        output_(output),
        rows_(network.inputs()),
        targets_(network.outputs()),
        outputs_(network.outputs()),
        derivatives_(network.outputs()),
        gradient_(network.parameters().size()) {
    if (output.code == neural::OutputGroup::Code::kGaussian) {
      code_.emplace(network.outputs(), output.first, output.spacing, output.width);
    }
  }

  void load(std::size_t lane, const float* inputs, double label) {
    for (std::size_t row = 0; row < rows_; ++row) {
      pass_.input(row)[lane] = static_cast<double>(inputs[row]);
    }
    labels_[lane] = label;
  }

  // Error of the first `count` lanes; with `learn`, gradient() is theirs.
  Error run(std::size_t count, bool learn) {
    pass_.forward();
    for (std::size_t o = 0; o < outputs_.size(); ++o) std::fill_n(pass_.outputGradient(o), kLanes, 0.0);
    Error error;
    for (std::size_t lane = 0; lane < count; ++lane) error.add(judge(lane));
    if (!learn) return error;
    std::fill(gradient_.begin(), gradient_.end(), 0.0);
    pass_.backward(gradient_);
    return error;
  }

  const std::vector<double>& gradient() const { return gradient_; }

 private:
  Error judge(std::size_t lane) {
    for (std::size_t o = 0; o < outputs_.size(); ++o) outputs_[o] = pass_.output(o)[lane];
    Error error;
    error.count = 1;
    double told;
    if (code_) {
      code_->encode(labels_[lane], targets_.data());
      error.loss =
          neural::crossEntropy(outputs_.data(), targets_.data(), outputs_.size(), derivatives_.data());
      told = code_->decode(outputs_.data()).value;
    } else {
      targets_[0] = (labels_[lane] - output_.offset) / output_.scale;
      error.loss = neural::halfSquaredError(outputs_.data(), targets_.data(), 1, derivatives_.data());
      told = output_.offset + output_.scale * outputs_[0];
    }
    error.squares = (told - labels_[lane]) * (told - labels_[lane]);
    for (std::size_t o = 0; o < outputs_.size(); ++o) pass_.outputGradient(o)[lane] = derivatives_[o];
    return error;
  }

  BatchPass pass_;
  neural::OutputGroup output_;
  std::optional<neural::GaussianCode> code_;
  std::size_t rows_;
  std::vector<double> targets_, outputs_, derivatives_;
  std::array<double, kLanes> labels_{};
  std::vector<double> gradient_;
};

void onEachThread(const std::function<void(std::size_t)>& work) {
  std::vector<std::thread> threads;
  for (std::size_t t = 1; t < kThreads; ++t) threads.emplace_back(work, t);
  work(0);
  for (std::thread& thread : threads) thread.join();
}

// The training proper, of a network that takes the columns of `plain` and `mirrored`.
class Training {
 public:
  Training(neural::Network& network, const neural::OutputGroup& output, const DataSet& examples,
           const TrainingOptions& options)
      : network_(network),
        examples_(examples),
        options_(options),
        adam_(network.parameters().size(), {options.rate, 0.9, 0.999, 1e-8, options.weight_decay}),
        random_(options.seed, simulation::Stream::kTraining),
        shown_(examples.size()),
        gradient_(network.parameters().size()) {
    for (std::size_t t = 0; t < kThreads; ++t) workers_.emplace_back(network, output);
    for (std::size_t i = 0; i < shown_.size(); ++i) shown_[i].example = i;
    steps_ = std::max<std::size_t>(1, examples.size() / kBatch);
  }

  Error epoch(const Eigen::MatrixXf& plain, const Eigen::MatrixXf& mirrored) {
    shuffle();
    std::array<Error, kThreads> errors{};
    Barrier learned(kThreads), stepped(kThreads);
    onEachThread([&](std::size_t t) {
      for (std::size_t s = 0; s < steps_; ++s) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
          const Shown& shown = shown_[(s * kBatch + t * kLanes + lane) % shown_.size()];
          const double label = static_cast<double>(examples_[shown.example].label);
          const auto column = static_cast<Index>(shown.example);
          workers_[t].load(lane, (shown.mirrored ? mirrored : plain).col(column).data(),
                           shown.mirrored ? -label : label);
        }
        errors[t].add(workers_[t].run(kLanes, true));
        learned.wait();
        if (t == 0) step();
        stepped.wait();
      }
    });
    if (failure_) std::rethrow_exception(failure_);
    for (std::size_t t = 1; t < kThreads; ++t) errors[0].add(errors[t]);
    return errors[0];
  }

  Error check(const Eigen::MatrixXf& inputs, const DataSet& examples) {
    std::array<Error, kThreads> errors{};
    onEachThread([&](std::size_t t) {
      for (std::size_t first = t * kLanes; first < examples.size(); first += kBatch) {
        const std::size_t count = std::min(kLanes, examples.size() - first);
        for (std::size_t lane = 0; lane < count; ++lane) {
          workers_[t].load(lane, inputs.col(static_cast<Index>(first + lane)).data(),
                           static_cast<double>(examples[first + lane].label));
        }
        errors[t].add(workers_[t].run(count, false));
      }
    });
    for (std::size_t t = 1; t < kThreads; ++t) errors[0].add(errors[t]);
    return errors[0];
  }

 private:
  struct Shown {
    std::size_t example = 0;
    bool mirrored = false;
  };

  void shuffle() {
    for (std::size_t i = shown_.size(); i > 1; --i) {
      const auto other = static_cast<std::size_t>(random_.uniform() * static_cast<double>(i));
      std::swap(shown_[i - 1], shown_[other]);
    }
    for (Shown& shown : shown_) shown.mirrored = random_.uniform() < 0.5;
  }

  void step() {
    for (std::size_t i = 0; i < gradient_.size(); ++i) {
      gradient_[i] = 0.0;
      for (const Worker& worker : workers_) gradient_[i] += worker.gradient()[i];
      gradient_[i] /= static_cast<double>(kBatch);
    }
    const double all = static_cast<double>(steps_) * options_.epochs;
    const double share = std::min(1.0, static_cast<double>(done_++) / all);
    const double fall = 0.5 * (1.0 + std::cos(M_PI * share));
    try {
      if (!failure_) {
        adam_.step(network_.parameters(), gradient_, kLastRate + (1.0 - kLastRate) * fall);
      }
    } catch (...) {
      failure_ = std::current_exception();  // the other thread waits: told after the epoch
    }
  }

  neural::Network& network_;
  const DataSet& examples_;
  TrainingOptions options_;
  std::vector<Worker> workers_;
  neural::Adam adam_;
  simulation::Random random_;
  std::vector<Shown> shown_;
  std::vector<double> gradient_;
  std::size_t steps_;
  std::size_t done_ = 0;
  std::exception_ptr failure_;
};

// The same network with a first layer that takes the components.
neural::Network innerNetwork(const neural::Network& outer, std::size_t inputs, std::uint64_t seed) {
  std::vector<neural::Layer> layers = outer.layers();
  layers.front() = neural::Layer::dense(inputs, layers.front().channels_out, layers.front().activation);
  neural::Network inner(std::move(layers));
  inner.randomise(seed);
  return inner;
}

}  // namespace

void trainNetwork(neural::NetworkFile& file, const DataSet& examples, const DataSet& validation,
                  const TrainingOptions& options,
                  const std::function<void(const TrainingProgress&)>& progress) {
  if (examples.empty() || validation.empty()) {
    throw std::invalid_argument("training needs examples, and others from tunnels held out");
  }
  std::optional<InputProjection> projection;
  const bool dense = file.network.layers().front().kind == neural::Layer::Kind::kDense;
  if (dense && options.components > 0) {
    projection = projectionOf(file, examples, options.components);
  }
  neural::Network network =
      projection ? innerNetwork(file.network, projection->size(), options.seed) : file.network;
  const Eigen::MatrixXf plain = inputsOf(file, examples, projection, false);
  const Eigen::MatrixXf mirrored = inputsOf(file, examples, projection, true);
  const Eigen::MatrixXf held_out = inputsOf(file, validation, projection, false);
  Training training(network, file.output, examples, options);
  neural::EarlyStopping best(static_cast<std::size_t>(options.patience));
  for (int epoch = 1; epoch <= options.epochs; ++epoch) {
    const Error learned = training.epoch(plain, mirrored);
    const Error checked = training.check(held_out, validation);
    const bool enough = best.stop(checked.meanLoss(), network.parameters());
    progress({epoch, learned.meanLoss(), checked.meanLoss(), checked.rms()});
    if (enough) break;
  }
  network.parameters() = best.bestParameters();
  if (projection) {
    projection->unfold(network, file.network);
  } else {
    file.network.parameters() = network.parameters();
  }
}

}  // namespace tunnel_pilot::learning
