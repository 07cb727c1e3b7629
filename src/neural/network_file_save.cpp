#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "network_text.h"
#include "plain_numbers.h"
#include "tunnel_pilot/config/node.h"
#include "tunnel_pilot/config/sha256.h"
#include "tunnel_pilot/neural/batch_pass.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::neural {
namespace {

using config::ConfigError;

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

std::string layerText(const Layer& layer) {
  const auto sizes = [](const std::string& key, std::size_t size) {
    return ", " + key + ": " + std::to_string(size);
  };
  std::string text = "  - {kind: ";
  if (layer.kind == Layer::Kind::kDense) {
    text += "dense" + sizes("inputs", layer.length_in) + sizes("outputs", layer.channels_out);
  } else {
    text += "convolution" + sizes("channels_in", layer.channels_in) +
            sizes("length_in", layer.length_in) + sizes("channels_out", layer.channels_out) +
            sizes("kernel", layer.kernel) + sizes("stride", layer.stride) +
            sizes("passed", layer.passed);
  }
  return text + ", activation: " + toString(layer.activation) + "}\n";
}

std::string inputText(const InputGroup& group) {
  const bool inverse = group.transform == InputGroup::Transform::kInverse;
  std::string text = "  - {meaning: " + quoted(group.meaning) + ", unit: " + quoted(group.unit) +
                     ", count: " + std::to_string(group.count) +
                     ", transform: " + (inverse ? "inverse" : "linear");
  if (!inverse) text += ", offset: " + shortest(group.offset);
  return text + ", scale: " + shortest(group.scale) + ", min: " + shortest(group.min) +
         ", max: " + shortest(group.max) + "}\n";
}

std::string outputText(const OutputGroup& group) {
  std::string text = "{meaning: " + quoted(group.meaning) + ", unit: " + quoted(group.unit);
  if (group.code == OutputGroup::Code::kValue) {
    text += ", code: value, offset: " + shortest(group.offset) + ", scale: " + shortest(group.scale);
  } else {
    text += ", code: gaussian, first: " + shortest(group.first) +
            ", spacing: " + shortest(group.spacing) + ", width: " + shortest(group.width);
  }
  if (group.small_lead_share != 1.0) text += ", small_lead_share: " + shortest(group.small_lead_share);
  return text + "}\n";
}

std::string trainingText(const std::string& training) {
  if (training.empty()) return "\"\"\n";
  std::string text = "|2-\n  ";
  for (const char c : training) text += c == '\n' ? std::string("\n  ") : std::string(1, c);
  return text + "\n";
}

// Values spread over the range of each input.
std::vector<float> goldenInput(const std::vector<InputGroup>& groups) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  std::vector<float> input;
  for (const InputGroup& group : groups) {
    for (std::size_t i = 0; i < group.count; ++i) {
      const double share = std::fmod(kGoldenRatio * static_cast<double>(input.size() + 1), 1.0);
      input.push_back(static_cast<float>(group.scaled(group.min + share * (group.max - group.min))));
    }
  }
  return input;
}

std::vector<float> goldenOutput(const Network& network, const std::vector<float>& input) {
  BatchPass pass(network);
  for (std::size_t i = 0; i < input.size(); ++i) pass.input(i)[0] = static_cast<double>(input[i]);
  pass.forward();
  std::vector<float> output;
  for (std::size_t i = 0; i < network.outputs(); ++i) {
    output.push_back(static_cast<float>(pass.output(i)[0]));
  }
  return output;
}

std::string domainText(const InputDomain& domain) {
  return "domain: {meaning: " + quoted(domain.meaning) +
         ", size: " + std::to_string(domain.mean.size()) + ", limit: " + shortest(domain.limit) +
         "}\ndomain_mean: |\n" + numberLines({domain.mean.begin(), domain.mean.end()}) +
         "domain_whitening: |\n" + numberLines({domain.whitening.begin(), domain.whitening.end()});
}

std::string fileText(const NetworkFile& file) {
  const PlainNumbers plain;
  std::string text = kFirstLine;
  text += "version: " + std::to_string(kVersion) + "\nname: " + quoted(file.name) + "\nlayers:\n";
  for (const Layer& layer : file.network.layers()) text += layerText(layer);
  text += "inputs:\n";
  for (const InputGroup& group : file.inputs) text += inputText(group);
  text += "output: " + outputText(file.output) + "training: " + trainingText(file.training);
  if (file.domain) text += domainText(*file.domain);
  const std::vector<double>& p = file.network.parameters();
  text += "parameters: |\n" + numberLines({p.begin(), p.end()});
  const std::vector<float> input = goldenInput(file.inputs);
  text += "golden_input: |\n" + numberLines(input);
  text += "golden_output: |\n" + numberLines(goldenOutput(file.network, input));
  return text + kHashKey + config::sha256(text) + "\n";
}

[[noreturn]] void refuseToSave(const std::string& file, const std::string& why) {
  throw ConfigError(file + ": " + why);
}

// A file that is gone with this object unless it was moved into place.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& target) : name_(target + ".XXXXXX") {
    descriptor_ = ::mkstemp(name_.data());
    if (descriptor_ < 0) refuseToSave(target, std::string("cannot be written: ") + std::strerror(errno));
  }
  ~TemporaryFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!moved_) ::unlink(name_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::string& name() const { return name_; }

  bool write(const std::string& text) {
    std::size_t done = 0;
    while (done < text.size()) {
      const ssize_t count = ::write(descriptor_, text.data() + done, text.size() - done);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return false;
      done += static_cast<std::size_t>(count);
    }
    // To the disk before the name changes, so that a power cut leaves the old file or the new one.
    return ::fchmod(descriptor_, 0644) == 0 && ::fsync(descriptor_) == 0;
  }
  bool moveTo(const std::string& target) {
    moved_ = std::rename(name_.c_str(), target.c_str()) == 0;
    return moved_;
  }

 private:
  std::string name_;
  int descriptor_ = -1;
  bool moved_ = false;
};

void roundToFloat(std::vector<double>& values) {
  for (double& value : values) value = static_cast<double>(static_cast<float>(value));
}

void normalise(NetworkFile& file) {
  roundToFloat(file.network.parameters());
  if (file.domain) {
    roundToFloat(file.domain->mean);
    roundToFloat(file.domain->whitening);
  }
  file.training.erase(file.training.find_last_not_of(" \n") + 1);
}

}  // namespace

void saveNetwork(const std::string& file, NetworkFile& network) {
  normalise(network);
  std::size_t inputs = 0;
  for (const InputGroup& group : network.inputs) inputs += group.count;
  if (inputs != network.network.inputs())
    refuseToSave(file, "the input groups are not the network's inputs");
  if (std::any_of(network.training.begin(), network.training.end(),
                  [](unsigned char c) { return c != '\n' && std::iscntrl(c) != 0; })) {
    refuseToSave(file, "the training record holds a control character");
  }
  const std::string text = fileText(network);
  NetworkFile read_back = parseNetwork(text, file);
  if (read_back.training != network.training || read_back.name != network.name ||
      read_back.network.parameters() != network.network.parameters()) {
    refuseToSave(file, "holds text that YAML cannot keep");
  }
  TemporaryFile temporary(file);
  if (!temporary.write(text) || loadNetwork(temporary.name()).sha256 != read_back.sha256 ||
      !temporary.moveTo(file)) {
    refuseToSave(file, std::string("cannot be written: ") + std::strerror(errno));
  }
  network.sha256 = read_back.sha256;
}

}  // namespace tunnel_pilot::neural
