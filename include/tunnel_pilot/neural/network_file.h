#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tunnel_pilot/neural/network.h"

namespace tunnel_pilot::neural {

/// What a run of inputs means and how it is scaled. Scaling is fixed: it never depends on the values of
/// one measurement. A value is clamped to [min, max] first, then
///   linear:   x = (value - offset) / scale
///   inverse:  x = scale / value              (min > 0)
struct InputGroup {
  enum class Transform : unsigned char { kLinear, kInverse };
  std::string meaning;  ///< e.g. "ranges", "articulation", "speed"
  std::string unit;     ///< of the value, e.g. "m", "rad", "m/s"
  std::size_t count = 1;
  Transform transform = Transform::kLinear;
  double offset = 0.0;
  double scale = 1.0;
  double min = 0.0;
  double max = 0.0;
};

/// What the outputs mean. Values: y = (value - offset) / scale, one output each. Gaussian: the outputs
/// are the probabilities of values that lie `spacing` apart from `first` on (GaussianCode).
struct OutputGroup {
  enum class Code : unsigned char { kValue, kGaussian };
  std::string meaning;  ///< e.g. "articulation_angle"
  std::string unit;
  Code code = Code::kValue;
  double offset = 0.0;   ///< value
  double scale = 1.0;    ///< value
  double first = 0.0;    ///< Gaussian
  double spacing = 0.0;  ///< Gaussian
  double width = 0.0;    ///< Gaussian: c of exp(-(d / spacing)^2 / c) [1]
};

/// A network with everything that is needed to use it: the content of a file of networks/.
struct NetworkFile {
  std::string name;
  Network network;
  std::vector<InputGroup> inputs;
  OutputGroup output;
  std::string training;  ///< how it came to be: program, data, seeds, figures; free text
  std::string sha256;    ///< of the file's content but for this line; set by load and save
};

/// Reads and checks a network file: format, version, sizes against each other, finite parameters of
/// magnitude below 1000, SHA-256, and that the network gives the file's golden output for its golden
/// input. Throws config::ConfigError with the reason; nothing is allocated for sizes that are refused.
NetworkFile loadNetwork(const std::string& file);

/// Writes `network` (parameters rounded to float first) with a new golden pair and hash, to a temporary
/// file that then takes the place of `file`, so that a half-written one is never seen. Sets sha256.
/// Throws config::ConfigError.
void saveNetwork(const std::string& file, NetworkFile& network);

}  // namespace tunnel_pilot::neural
