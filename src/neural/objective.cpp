#include "tunnel_pilot/neural/objective.h"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace tunnel_pilot::neural {
namespace {

constexpr std::size_t kLanes = BatchPass::kLanes;

std::size_t checkedCount(const Network& network, const Samples& samples) {
  const std::size_t count = samples.inputs.size() / network.inputs();
  if (count == 0 || samples.inputs.size() != count * network.inputs() ||
      samples.targets.size() != count * network.outputs()) {
    throw std::invalid_argument("the samples do not suit the network's inputs and outputs");
  }
  return count;
}

void setParameters(Network& network, const std::vector<double>& parameters) {
  if (parameters.size() != network.parameters().size()) {
    throw std::invalid_argument("the network has another number of parameters");
  }
  network.parameters() = parameters;
}

// Samples from `first` on into the lanes of the input; returns how many.
std::size_t fill(BatchPass& pass, std::size_t inputs, const Samples& samples, std::size_t first,
                 std::size_t count) {
  const std::size_t lanes = std::min(kLanes, count - first);
  for (std::size_t i = 0; i < inputs; ++i) {
    double* row = pass.input(i);
    for (std::size_t l = 0; l < lanes; ++l) row[l] = samples.inputs[(first + l) * inputs + i];
    std::fill(row + lanes, row + kLanes, 0.0);
  }
  return lanes;
}

}  // namespace

NetworkObjective::NetworkObjective(Network& network, const Samples& samples, Loss loss)
    : network_(&network),
      samples_(&samples),
      loss_(loss),
      count_(checkedCount(network, samples)),
      pass_(network) {}

double NetworkObjective::operator()(const std::vector<double>& parameters,
                                    std::vector<double>* gradient) {
  setParameters(*network_, parameters);
  if (gradient != nullptr) gradient->assign(parameters.size(), 0.0);
  double sum = 0.0;
  for (std::size_t first = 0; first < count_; first += kLanes) sum += batch(first, gradient);
  const double share = 1.0 / static_cast<double>(count_);
  if (gradient != nullptr) {
    for (double& g : *gradient) g *= share;
  }
  return sum * share;
}

double NetworkObjective::batch(std::size_t first, std::vector<double>* gradient) {
  const std::size_t outputs = network_->outputs();
  const std::size_t lanes = fill(pass_, network_->inputs(), *samples_, first, count_);
  pass_.forward();
  double sum = 0.0;
  for (std::size_t o = 0; o < outputs; ++o) {
    std::array<double, kLanes> targets{};
    for (std::size_t l = 0; l < lanes; ++l) targets[l] = samples_->targets[(first + l) * outputs + o];
    sum += loss_(pass_.output(o), targets.data(), lanes, pass_.outputGradient(o));
    std::fill(pass_.outputGradient(o) + lanes, pass_.outputGradient(o) + kLanes, 0.0);
  }
  if (gradient != nullptr) pass_.backward(*gradient);
  return sum;
}

NetworkResiduals::NetworkResiduals(Network& network, const Samples& samples)
    : network_(&network),
      samples_(&samples),
      count_(checkedCount(network, samples)),
      pass_(network),
      row_(network.parameters().size()) {}

void NetworkResiduals::operator()(const std::vector<double>& parameters, std::vector<double>& errors,
                                  std::vector<double>* jacobian) {
  setParameters(*network_, parameters);
  const std::size_t outputs = network_->outputs();
  errors.resize(count_ * outputs);
  if (jacobian != nullptr) jacobian->resize(errors.size() * parameters.size());
  for (std::size_t first = 0; first < count_; first += kLanes) {
    const std::size_t lanes = fill(pass_, network_->inputs(), *samples_, first, count_);
    pass_.forward();
    for (std::size_t l = 0; l < lanes; ++l) {
      const std::size_t row = (first + l) * outputs;
      for (std::size_t o = 0; o < outputs; ++o) {
        errors[row + o] = samples_->targets[row + o] - pass_.output(o)[l];
      }
      if (jacobian != nullptr) differentiate(l, row, *jacobian);
    }
  }
}

// A backward pass for each output of one lane: its gradient is 1, all others are 0.
void NetworkResiduals::differentiate(std::size_t lane, std::size_t first_row,
                                     std::vector<double>& jacobian) {
  for (std::size_t o = 0; o < network_->outputs(); ++o) {
    for (std::size_t other = 0; other < network_->outputs(); ++other) {
      std::fill_n(pass_.outputGradient(other), kLanes, 0.0);
    }
    pass_.outputGradient(o)[lane] = 1.0;
    std::fill(row_.begin(), row_.end(), 0.0);
    pass_.backward(row_);
    const auto to = static_cast<std::ptrdiff_t>((first_row + o) * row_.size());
    std::copy(row_.begin(), row_.end(), jacobian.begin() + to);
  }
}

}  // namespace tunnel_pilot::neural
