#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "tunnel_pilot/config/sha256.h"
#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::neural {

/// A small network with everything a file can hold: both kinds of layers, both kinds of scaling.
inline NetworkFile smallNetwork() {
  Network network({Layer::convolution(1, 12, 2, 3, 2, 1, Activation::kRelu),
                   Layer::dense(11, 4, Activation::kTanh), Layer::dense(4, 5, Activation::kSigmoid)});
  network.randomise(7);
  std::vector<InputGroup> inputs = {
      {"ranges", "m", 12, InputGroup::Transform::kInverse, 0.0, 1.0, 0.5, 40.0},
      {"articulation", "rad", 1, InputGroup::Transform::kLinear, 0.1, 0.7854, -0.8, 0.8}};
  OutputGroup output{
      "articulation_angle", "rad", OutputGroup::Code::kGaussian, 0.0, 1.0, -0.2, 0.1, 5.0};
  return {"small", network, inputs, output, "made by a test\n  with two lines: seed 7 # no comment", ""};
}

/// A folder of its own that is gone with the object.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "network_XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string file(const std::string& name) const { return path_ + "/" + name; }
  std::size_t entries() const {
    std::size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) count += entry.exists() ? 1 : 0;
    return count;
  }

 private:
  std::string path_;
};

inline std::string contentOf(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream content;
  content << in.rdbuf();
  return content.str();
}

inline std::string textOf(NetworkFile network) {
  const Folder folder;
  saveNetwork(folder.file("network.yaml"), network);
  return contentOf(folder.file("network.yaml"));
}

/// The text with the hash line that suits its content, in place of its last line.
inline std::string resigned(const std::string& text) {
  const std::size_t line = text.rfind("sha256: ");
  const std::string content = line == std::string::npos ? text : text.substr(0, line);
  return content + "sha256: " + config::sha256(content) + "\n";
}

}  // namespace tunnel_pilot::neural
