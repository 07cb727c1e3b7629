#include "tunnel_pilot/neural/network_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "network_text.h"
#include "plain_numbers.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/config/sha256.h"
#include "tunnel_pilot/neural/gaussian_code.h"
#include "tunnel_pilot/neural/inference.h"

namespace tunnel_pilot::neural {
namespace {

using config::ConfigError;
using config::Node;

// Whatever a file holds, a message stays one line.
[[noreturn]] void refuse(const std::string& source, const std::string& why) {
  std::string message = source + ": " + why;
  std::replace_if(
      message.begin(), message.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  throw ConfigError(message);
}

std::string readWhole(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) refuse(file, "does not exist");
  if (fs::is_directory(status)) refuse(file, "is a directory");
  if (!fs::is_regular_file(status)) refuse(file, "is not a regular file");
  const std::uintmax_t size = fs::file_size(file, error);
  if (error || size > kMaxFileBytes) refuse(file, "is larger than 64 MiB");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) refuse(file, "cannot be opened");
  std::string content(static_cast<std::size_t>(size), '\0');
  stream.read(content.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(stream.gcount()) != size) refuse(file, "cannot be read");
  return content;
}

// The hash that the last line tells, once it is known to be that of all before it.
std::string checkedHash(const std::string& content, const std::string& source) {
  if (content.compare(0, sizeof kFirstLine - 1, kFirstLine) != 0) {
    refuse(source, "is not a network file: its first line must be 'format: tunnel_pilot_network'");
  }
  const std::size_t line = content.size() < kHashLine ? 0 : content.size() - kHashLine;
  if (line == 0 || content[line - 1] != '\n' || content.back() != '\n' ||
      content.compare(line, sizeof kHashKey - 1, kHashKey) != 0) {
    refuse(source, "does not end with the line 'sha256: ...': it is cut short, or was written to");
  }
  std::string told = content.substr(line + sizeof kHashKey - 1, 64);
  if (config::sha256(content.substr(0, line)) != told) {
    refuse(source, "has not the content that its sha256 tells: it was changed or damaged");
  }
  return told;
}

// Takes `key`'s block of numbers out of the text: indented lines, too many for a general YAML reader.
std::string cutBlock(std::string& text, const std::string& key, const std::string& source) {
  const std::string head = "\n" + key + ": |\n";
  const std::size_t begin = text.find(head);
  if (begin == std::string::npos) refuse(source, "'" + key + "' is missing, or is no block of numbers");
  const std::size_t first = begin + head.size();
  std::size_t end = first;
  while (text.compare(end, 2, "  ") == 0) end = std::min(text.find('\n', end), text.size() - 1) + 1;
  std::string block = text.substr(first, end - first);
  text.erase(begin + 1, end - begin - 1);
  return block;
}

std::size_t readSize(Node& node, const std::string& key, std::size_t max = Network::kMaxWidth) {
  return static_cast<std::size_t>(node.integer(key, "1", 1, static_cast<std::int64_t>(max)));
}

Activation readActivation(Node& node) {
  const std::string name = node.choice("activation", {"linear", "tanh", "sigmoid", "relu"});
  for (const Activation a : {Activation::kTanh, Activation::kSigmoid, Activation::kRelu}) {
    if (toString(a) == name) return a;
  }
  return Activation::kLinear;
}

Layer readLayer(Node& node) {
  const bool dense = node.choice("kind", {"dense", "convolution"}) == "dense";
  const Activation activation = readActivation(node);
  Layer layer;
  if (dense) {
    const std::size_t inputs = readSize(node, "inputs");
    layer = Layer::dense(inputs, readSize(node, "outputs"), activation);
  } else {
    const std::size_t channels_in = readSize(node, "channels_in");
    const std::size_t length_in = readSize(node, "length_in");
    const std::size_t channels_out = readSize(node, "channels_out");
    const std::size_t kernel = readSize(node, "kernel");
    const std::size_t stride = readSize(node, "stride");
    const auto passed = static_cast<std::size_t>(node.integer("passed", "1", 0, Network::kMaxWidth));
    layer = Layer::convolution(channels_in, length_in, channels_out, kernel, stride, passed, activation);
  }
  node.finish();
  return layer;
}

Network readLayers(Node& file) {
  std::vector<Node> nodes = file.children("layers");
  if (nodes.empty() || nodes.size() > kMaxLayers) file.refuse("layers", "must be a list of 1 to 64");
  std::vector<Layer> layers;
  layers.reserve(nodes.size());
  for (Node& node : nodes) layers.push_back(readLayer(node));
  try {
    Network network(layers);
    std::size_t work = 0;
    for (const Layer& layer : layers) work += layer.weights() * layer.lengthOut();
    if (work > kMaxWork) file.refuse("layers", "make more than 200 million multiplications");
    return network;
  } catch (const std::invalid_argument& e) {
    file.refuse("layers", std::string("do not fit: ") + e.what());
  }
}

// Names are short and plain: they stand in messages, logs and topics.
std::string readName(Node& node, const std::string& key) {
  std::string name = node.text(key);
  const bool plain = std::all_of(name.begin(), name.end(),
                                 [](unsigned char c) { return c < 0x7F && std::isprint(c) != 0; });
  if (name.empty() || name.size() > kMaxName || !plain) {
    node.refuse(key, "must be 1 to 100 printable characters");
  }
  return name;
}

InputGroup readInput(Node& node) {
  InputGroup group;
  group.meaning = readName(node, "meaning");
  group.unit = readName(node, "unit");
  group.count = readSize(node, "count");
  const bool inverse = node.choice("transform", {"linear", "inverse"}) == "inverse";
  group.transform = inverse ? InputGroup::Transform::kInverse : InputGroup::Transform::kLinear;
  if (!inverse) group.offset = node.number("offset", group.unit, -1e6, 1e6);
  group.scale = node.number("scale", group.unit, 1e-6, 1e6);
  group.min = node.number("min", group.unit, inverse ? 1e-6 : -1e6, 1e6);
  group.max = node.number("max", group.unit, -1e6, 1e6);
  if (group.max <= group.min) node.refuse("max", "must be above 'min'");
  node.finish();
  return group;
}

std::vector<InputGroup> readInputs(Node& file, const Network& network) {
  std::vector<Node> nodes = file.children("inputs");
  if (nodes.empty() || nodes.size() > kMaxLayers) file.refuse("inputs", "must be a list of 1 to 64");
  std::vector<InputGroup> groups;
  groups.reserve(nodes.size());
  std::size_t count = 0;
  for (Node& node : nodes) {
    groups.push_back(readInput(node));
    count += groups.back().count;
  }
  if (count != network.inputs()) {
    file.refuse("inputs", "are " + std::to_string(count) + " values, the first layer takes " +
                              std::to_string(network.inputs()));
  }
  return groups;
}

OutputGroup readOutput(Node node, const Network& network) {
  OutputGroup group;
  group.meaning = readName(node, "meaning");
  group.unit = readName(node, "unit");
  if (node.choice("code", {"value", "gaussian"}) == "value") {
    group.offset = node.number("offset", group.unit, -1e6, 1e6);
    group.scale = node.number("scale", group.unit, 1e-6, 1e6);
  } else {
    group.code = OutputGroup::Code::kGaussian;
    group.first = node.number("first", group.unit, -1e6, 1e6);
    group.spacing = node.number("spacing", group.unit, 1e-6, 1e6);
    group.width = node.number("width", "1", 0.5, 100.0);
    try {
      GaussianCode(network.outputs(), group.first, group.spacing, group.width);
    } catch (const std::invalid_argument& e) {
      node.refuse("code", std::string("does not suit the last layer: ") + e.what());
    }
  }
  if (node.has("small_lead_share")) {
    group.small_lead_share = node.number("small_lead_share", "1", 0.1, 1.0);
  }
  node.finish();
  return group;
}

std::vector<float> readNumbers(const std::string& block, std::size_t count, float limit,
                               const std::string& what, const std::string& source) {
  try {
    return parseNumbers(block, count, limit, what);
  } catch (const std::invalid_argument& e) {
    refuse(source, e.what());
  }
}

// The map `domain` and its two blocks, which stand there or do not stand there together.
std::optional<InputDomain> readDomain(Node& header, const std::string& mean,
                                      const std::string& whitening, const std::string& source) {
  if (!header.has("domain")) return std::nullopt;
  Node node = header.child("domain");
  InputDomain domain;
  domain.meaning = readName(node, "meaning");
  const std::size_t size = readSize(node, "size", InputDomain::kMaxSize);
  domain.limit = node.number("limit", "1", 1e-3, 1e9);
  node.finish();
  const auto take = [&source](const std::string& block, std::size_t count, const std::string& what) {
    const std::vector<float> read = readNumbers(block, count, kDomainLimit, what, source);
    return std::vector<double>(read.begin(), read.end());
  };
  domain.mean = take(mean, size, "domain_mean number");
  domain.whitening = take(whitening, size * (size + 1) / 2, "domain_whitening number");
  return domain;
}

void checkGolden(const Network& network, const std::vector<float>& input,
                 const std::vector<float>& expected, const std::string& source) {
  Inference inference(network);
  std::vector<float> output(expected.size());
  inference.run(input.data(), output.data());
  for (std::size_t i = 0; i < output.size(); ++i) {
    const float error = std::abs(output[i] - expected[i]);
    if (!(error <= kGoldenTolerance * std::max(1.0F, std::abs(expected[i])))) {
      refuse(source, "gives " + std::to_string(output[i]) + " as output " + std::to_string(i + 1) +
                         " of its golden pair, which says " + std::to_string(expected[i]));
    }
  }
}

Node readHeader(const std::string& text, const std::string& source) {
  if (text.size() > kMaxHeaderBytes) refuse(source, "has more than 1 MiB beside its numbers");
  return config::parseText(text, source);
}

NetworkFile parse(std::string text, const std::string& source) {
  const std::string parameters = cutBlock(text, "parameters", source);
  const std::string golden_input = cutBlock(text, "golden_input", source);
  const std::string golden_output = cutBlock(text, "golden_output", source);
  const bool has_domain = text.find("\ndomain: ") != std::string::npos;
  const std::string mean = has_domain ? cutBlock(text, "domain_mean", source) : "";
  const std::string whitening = has_domain ? cutBlock(text, "domain_whitening", source) : "";
  Node header = readHeader(text, source);
  header.choice("format", {"tunnel_pilot_network"});
  header.integer("version", "1", kVersion, kVersion);
  std::string name = readName(header, "name");
  NetworkFile file{std::move(name), readLayers(header), {}, {}, {}, {}};
  file.inputs = readInputs(header, file.network);
  file.output = readOutput(header.child("output"), file.network);
  file.training = header.text("training");
  const PlainNumbers plain;
  file.domain = readDomain(header, mean, whitening, source);
  header.finish();
  std::vector<double>& own = file.network.parameters();
  const std::vector<float> read =
      readNumbers(parameters, own.size(), kParameterLimit, "parameter", source);
  std::copy(read.begin(), read.end(), own.begin());
  checkGolden(file.network,
              readNumbers(golden_input, file.network.inputs(), kGoldenLimit, "golden input", source),
              readNumbers(golden_output, file.network.outputs(), kGoldenLimit, "golden output", source),
              source);
  return file;
}

}  // namespace

double InputGroup::scaled(double value) const {
  const double held = std::clamp(value, min, max);
  return transform == Transform::kInverse ? scale / held : (held - offset) / scale;
}

NetworkFile parseNetwork(const std::string& content, const std::string& source) {
  if (content.size() > kMaxFileBytes) refuse(source, "is larger than 64 MiB");
  const std::string hash = checkedHash(content, source);
  NetworkFile file = parse(content.substr(0, content.size() - kHashLine), source);
  file.sha256 = hash;
  return file;
}

NetworkFile loadNetwork(const std::string& file) { return parseNetwork(readWhole(file), file); }

}  // namespace tunnel_pilot::neural
