#pragma once

#include <cstddef>
#include <optional>
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

  /// The network's input for a value, which must be finite.
  double scaled(double value) const;
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
  /// How much is meant of a value that leads the present one by little [1]: an answer learned from a
  /// teacher that knows the truck is too sharp for one that does not. LidarDriver says how it is used.
  double small_lead_share = 1.0;
};

/// Where the inputs lay in training: d^2 = |W (f - mean)|^2 of n features f of the inputs, W lower
/// triangular (Mahalanobis distance).
struct InputDomain {
  static constexpr std::size_t kMaxSize = 256;
  std::string meaning;            ///< which features
  double limit = 0.0;             ///< of d^2: nearly all of training lay within [1]
  std::vector<double> mean;       ///< n
  std::vector<double> whitening;  ///< W's lower triangle, row after row: n (n + 1) / 2
};

/// A network with everything that is needed to use it: the content of a file of networks/.
struct NetworkFile {
  std::string name;
  Network network;
  std::vector<InputGroup> inputs;
  OutputGroup output;
  std::string training;  ///< how it came to be: program, data, seeds, figures; free text
  std::string sha256;    ///< of the file's content but for this line; set by load and save
  std::optional<InputDomain> domain = std::nullopt;
};

/// Reads and checks a network file (docs/neural.md): at most 64 MiB, format, version, SHA-256, no
/// unknown or missing key, sizes against each other, finite parameters of magnitude below 1000, and that
/// Inference gives the file's golden output for its golden input, within 1e-5. Throws
/// config::ConfigError with the reason; nothing is allocated for sizes that are refused.
NetworkFile loadNetwork(const std::string& file);

/// The same from a file's content; `source` names it in messages.
NetworkFile parseNetwork(const std::string& content, const std::string& source);

/// Writes `network` with a new golden pair and hash, to a temporary file in the same folder that is read
/// back and then takes the place of `file`, so that neither a half-written nor an unreadable one is ever
/// seen there. Changes in `network`: parameters are rounded to float, spaces at the end of `training`
/// are dropped, sha256 is set. Throws config::ConfigError; what stood at `file` then stands there still.
void saveNetwork(const std::string& file, NetworkFile& network);

}  // namespace tunnel_pilot::neural
