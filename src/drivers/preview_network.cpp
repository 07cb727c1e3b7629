#include "tunnel_pilot/drivers/preview_network.h"

#include <algorithm>
#include <cmath>

namespace tunnel_pilot::drivers {
namespace {

using neural::Activation;
using neural::InputGroup;
using neural::Layer;
using neural::NetworkFile;
using neural::OutputGroup;

constexpr std::array<const char*, PreviewNetwork::kInputs> kMeanings = {
    "road_preview", "lateral_acceleration", "lateral_speed", "lateral_position"};
constexpr std::array<const char*, PreviewNetwork::kInputs> kUnits = {"m", "m/s^2", "m/s", "m"};

bool isDense(const Layer& layer, std::size_t inputs, std::size_t outputs, Activation activation) {
  return layer.kind == Layer::Kind::kDense && layer.inputs() == inputs && layer.outputs() == outputs &&
         layer.activation == activation;
}

std::array<InputGroup, PreviewNetwork::kInputs> checkedInputs(const NetworkFile& file) {
  std::array<InputGroup, PreviewNetwork::kInputs> groups;
  bool right = file.inputs.size() == groups.size();
  for (std::size_t i = 0; right && i < groups.size(); ++i) {
    groups[i] = file.inputs[i];
    right = groups[i].meaning == kMeanings[i] && groups[i].unit == kUnits[i] && groups[i].count == 1 &&
            groups[i].transform == InputGroup::Transform::kLinear;
  }
  if (!right) {
    throw config::ConfigError(file.name + ": its inputs are not road_preview, lateral_acceleration, " +
                              "lateral_speed and lateral_position, one each and linear");
  }
  return groups;
}

neural::Network hiddenLayer(const NetworkFile& file) {
  const std::vector<Layer>& layers = file.network.layers();
  if (layers.size() != 2 ||
      !isDense(layers[0], PreviewNetwork::kInputs, PreviewNetwork::kHidden, Activation::kSigmoid) ||
      !isDense(layers[1], PreviewNetwork::kHidden, 1, Activation::kLinear)) {
    throw config::ConfigError(file.name +
                              ": is no network of 4 inputs, 10 sigmoid nodes and 1 linear output");
  }
  if (file.output.meaning != "articulation_angle" || file.output.unit != "rad" ||
      file.output.code != OutputGroup::Code::kValue) {
    throw config::ConfigError(file.name + ": its output is no value of the articulation angle");
  }
  neural::Network hidden({layers[0]});
  std::copy_n(file.network.parameters().begin(), layers[0].parameters(), hidden.parameters().begin());
  return hidden;
}

}  // namespace

std::vector<InputGroup> previewInputGroups(const PreviewInputs& range) {
  const std::array<double, PreviewNetwork::kInputs> ranges = {
      range.road_preview, range.lateral_acceleration, range.lateral_speed, range.lateral_position};
  std::vector<InputGroup> groups(ranges.size());
  for (std::size_t i = 0; i < groups.size(); ++i) {
    groups[i].meaning = kMeanings[i];
    groups[i].unit = kUnits[i];
    groups[i].scale = ranges[i];
    groups[i].min = -ranges[i];
    groups[i].max = ranges[i];
  }
  return groups;
}

PreviewNetwork::PreviewNetwork(const NetworkFile& file, const AdaptationParameters& adaptation)
    : adaptation_(adaptation), scaling_(checkedInputs(file)), hidden_layer_(hiddenLayer(file)) {
  const double* output_layer =
      file.network.parameters().data() + file.network.layers().front().parameters();
  for (std::size_t j = 0; j < kHidden; ++j) trained_[j] = file.output.scale * output_layer[j];
  bias_ = file.output.scale * output_layer[kHidden] + file.output.offset;
  reset();
}

void PreviewNetwork::reset() {
  weights_ = trained_;
  before_ = trained_;
  hidden_.fill(0.0);
}

double PreviewNetwork::run(const PreviewInputs& inputs) {
  const std::array<double, kInputs> values = {inputs.road_preview, inputs.lateral_acceleration,
                                              inputs.lateral_speed, inputs.lateral_position};
  std::array<float, kInputs> scaled{};
  for (std::size_t i = 0; i < kInputs; ++i) {
    const double value = std::clamp(values[i], scaling_[i].min, scaling_[i].max);
    scaled[i] = static_cast<float>((value - scaling_[i].offset) / scaling_[i].scale);
  }
  std::array<float, kHidden> hidden{};
  hidden_layer_.run(scaled.data(), hidden.data());
  double output = bias_;
  for (std::size_t j = 0; j < kHidden; ++j) {
    hidden_[j] = static_cast<double>(hidden[j]);
    output += weights_[j] * hidden_[j];
  }
  return output;
}

void PreviewNetwork::learn(double error, double share) {
  if (!adaptation_.enabled || !std::isfinite(error)) return;
  for (std::size_t j = 0; j < kHidden; ++j) {
    const double step = adaptation_.rate * share * error * hidden_[j];
    const double moment = adaptation_.momentum * (weights_[j] - before_[j]);
    before_[j] = weights_[j];
    weights_[j] = std::clamp(weights_[j] + step + moment, trained_[j] - adaptation_.bound,
                             trained_[j] + adaptation_.bound);
  }
}

}  // namespace tunnel_pilot::drivers
