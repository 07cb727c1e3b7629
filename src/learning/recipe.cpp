#include "tunnel_pilot/learning/recipe.h"

#include <cmath>
#include <filesystem>

#include "tunnel_pilot/drivers/preview_parameters.h"

namespace tunnel_pilot::learning {
namespace {

std::string beside(config::Node& node, const std::string& key, const std::filesystem::path& base) {
  const std::filesystem::path path = (base / node.text(key)).lexically_normal();
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    node.refuse(key, "names '" + path.string() + "', which is not there");
  return path.string();
}

std::size_t size(config::Node& node, const std::string& key, std::int64_t min, std::int64_t max) {
  return static_cast<std::size_t>(node.integer(key, "1", min, max));
}

NetworkDesign loadDesign(config::Node node) {
  NetworkDesign design;
  design.inverse_ranges = node.choice("ranges", {"linear", "inverse"}) == "inverse";
  const std::string truck = node.choice("truck", {"none", "articulation", "all"});
  design.truck = truck == "all"            ? NetworkDesign::Truck::kAll
                 : truck == "articulation" ? NetworkDesign::Truck::kArticulation
                                           : NetworkDesign::Truck::kNone;
  for (config::Node& layer : node.children("convolutions")) {
    design.convolutions.push_back(
        {size(layer, "channels", 1, 256), size(layer, "kernel", 1, 101), size(layer, "stride", 1, 16)});
    layer.finish();
  }
  for (const double width : node.numbers("hidden", "1", 1.0, 1000.0, 1, 8)) {
    design.hidden.push_back(static_cast<std::size_t>(width));
  }
  const std::string activation = node.choice("activation", {"sigmoid", "tanh", "relu"});
  design.activation = activation == "sigmoid" ? neural::Activation::kSigmoid
                      : activation == "tanh"  ? neural::Activation::kTanh
                                              : neural::Activation::kRelu;
  design.gaussian = node.choice("output", {"gaussian", "value"}) == "gaussian";
  design.small_lead_share = node.number("small_lead_share", "1", 0.1, 1.0);
  node.finish();
  return design;
}

SceneSource loadScenes(config::Node node, const std::filesystem::path& base) {
  SceneSource source;
  source.world_file = beside(node, "world", base);
  source.tunnels = static_cast<int>(node.integer("tunnels", "1", 1, 1000));
  source.examples = size(node, "examples", 1, 100'000);
  source.spread.offset = node.number("offset", "m", 0.0, 10.0);
  source.spread.heading = node.number("heading", "rad", 0.0, 1.0);
  source.spread.articulation = node.number("articulation", "rad", 0.0, 0.7);
  source.spread.lean = node.number("lean", "rad", 0.0, 0.5);
  source.spread.speed_min = node.number("speed_min", "m/s", 0.1, 10.0);
  source.spread.speed_max = node.number("speed_max", "m/s", source.spread.speed_min, 10.0);
  node.finish();
  return source;
}

DriveSource loadDrives(config::Node node, const std::filesystem::path& base) {
  DriveSource source;
  source.scenario_file = beside(node, "scenario", base);
  source.tunnels = static_cast<int>(node.integer("tunnels", "1", 1, 1000));
  source.variation = node.number("variation", "1", 0.0, 0.45);
  source.speed_min = node.number("speed_min", "m/s", 0.1, 10.0);
  source.speed_max = node.number("speed_max", "m/s", source.speed_min, 10.0);
  source.offset = node.number("offset", "m", 0.0, 10.0);
  source.heading = node.number("heading", "rad", 0.0, 1.0);
  node.finish();
  return source;
}

TrainingOptions loadTraining(config::Node& node) {
  TrainingOptions options;
  options.epochs = static_cast<int>(node.integer("epochs", "1", 1, 10'000));
  options.patience = static_cast<int>(node.integer("patience", "1", 1, 10'000));
  options.rate = node.number("rate", "1", 1e-6, 1.0);
  options.weight_decay = node.number("weight_decay", "1", 0.0, 1.0);
  options.components = size(node, "components", 0, drivers::LidarInputs::kBeams);
  return options;
}

neural::InputGroup truckInput(const char* meaning, const char* unit, double offset, double scale,
                              double min, double max) {
  return {meaning, unit, 1, neural::InputGroup::Transform::kLinear, offset, scale, min, max};
}

}  // namespace

Recipe loadRecipe(const std::string& file) {
  config::Node node = config::loadFile(file);
  const std::filesystem::path base = std::filesystem::path(file).parent_path();
  Recipe recipe;
  recipe.file = file;
  recipe.name = node.text("name");
  if (recipe.name != std::filesystem::path(file).stem().string()) {
    node.refuse("name", "must be that of the file");
  }
  recipe.base_scenario = beside(node, "scenario", base);
  recipe.seed = static_cast<std::uint64_t>(node.integer("seed", "1", 0, 1'000'000'000));
  recipe.design = loadDesign(node.child("network"));
  recipe.teacher = loadTeacher(node.child("teacher"));
  for (config::Node& source : node.children("scenes")) {
    recipe.scenes.push_back(loadScenes(std::move(source), base));
  }
  for (config::Node& source : node.children("drives")) {
    recipe.drives.push_back(loadDrives(std::move(source), base));
  }
  config::Node training = node.child("training");
  recipe.rounds = static_cast<int>(training.integer("rounds", "1", 0, 100));
  recipe.held_out = static_cast<int>(training.integer("held_out", "1", 1, 100));
  recipe.epochs_between = static_cast<int>(training.integer("epochs_between", "1", 1, 10'000));
  recipe.training = loadTraining(training);
  recipe.training.seed = recipe.seed;
  training.finish();
  node.finish();
  return recipe;
}

neural::NetworkFile makeNetwork(const NetworkDesign& design, const std::string& name) {
  using neural::InputGroup;
  using neural::Layer;
  std::vector<InputGroup> inputs;
  if (design.inverse_ranges) {
    inputs.push_back({"ranges", "m", drivers::LidarInputs::kBeams, InputGroup::Transform::kInverse, 0.0,
                      2.0, 0.5, 40.0});
  } else {
    inputs.push_back({"ranges", "m", drivers::LidarInputs::kBeams, InputGroup::Transform::kLinear, 0.0,
                      40.0, 0.0, 40.0});
  }
  if (design.truck != NetworkDesign::Truck::kNone) {
    inputs.push_back(truckInput("articulation", "rad", 0.0, 0.4, -0.79, 0.79));
  }
  if (design.truck == NetworkDesign::Truck::kAll) {
    inputs.push_back(truckInput("articulation_ahead", "rad", 0.0, 0.4, -0.79, 0.79));
    inputs.push_back(truckInput("speed", "m/s", 3.0, 2.0, 0.0, 10.0));
    inputs.push_back(truckInput("yaw_gain", "1", 1.0, 0.2, 0.5, 1.5));
    inputs.push_back(truckInput("yaw_disturbance", "1/m", 0.0, 0.006, -0.02, 0.02));
    inputs.push_back(truckInput("steering_rate", "rad/s", 0.25, 0.05, 0.1, 0.5));
  }
  const std::size_t passed = inputs.size() - 1;
  std::vector<Layer> layers;
  std::size_t channels = 1;
  std::size_t length = drivers::LidarInputs::kBeams;
  for (const NetworkDesign::Convolution& c : design.convolutions) {
    layers.push_back(Layer::convolution(channels, length, c.channels, c.kernel, c.stride, passed,
                                        neural::Activation::kRelu));
    channels = c.channels;
    length = layers.back().lengthOut();
  }
  std::size_t width = channels * length + passed;
  for (const std::size_t hidden : design.hidden) {
    layers.push_back(Layer::dense(width, hidden, design.activation));
    width = hidden;
  }
  neural::OutputGroup output;
  output.meaning = "articulation_angle";
  output.unit = "rad";
  output.small_lead_share = design.small_lead_share;
  if (design.gaussian) {
    output.code = neural::OutputGroup::Code::kGaussian;
    output.first = -M_PI / 4.0;
    output.spacing = M_PI / 60.0;
    output.width = 5.0;
    layers.push_back(Layer::dense(width, 31, neural::Activation::kSigmoid));
  } else {
    output.scale = 0.4;
    layers.push_back(Layer::dense(width, 1, neural::Activation::kLinear));
  }
  return {name, neural::Network(std::move(layers)), std::move(inputs), output, "", "", std::nullopt};
}

}  // namespace tunnel_pilot::learning
