#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "tunnel_pilot/neural/network_file.h"

namespace tunnel_pilot::drivers {

/// Tells whether a scan is like those that a network was trained on: the squared Mahalanobis distance of
/// 19 sectors' features from the training's mean. A feature is the logarithm of the sector's mean 1/r,
/// so that a factor counts alike near and far.
class ScanDomain {
 public:
  static constexpr std::size_t kSectors = 19;
  static constexpr char kMeaning[] = "log_mean_inverse_range_of_sectors";
  using Features = std::array<double, kSectors>;

  /// `source` names the file in messages. Throws config::ConfigError for a domain of other features.
  ScanDomain(const neural::InputDomain& domain, const std::string& source);

  /// Of 1/r of all beams [1/m], as invertRanges gives them; at least kSectors positive numbers.
  static Features features(const std::vector<float>& inverse);

  /// Mean, covariance and limit of examples: the limit is 0.6 of the d^2 within which the share 0.999
  /// of them lies. Throws std::invalid_argument for less than 10 kSectors examples or numbers that are
  /// not finite.
  static neural::InputDomain fit(const std::vector<Features>& examples);

  /// d^2 of the features of a scan [1].
  double distance(const Features& features) const;

  /// 1 within the limit, (limit / d^2)^2 beyond.
  double familiarity(const std::vector<float>& inverse) const;

 private:
  double limit_;
  Features mean_{};
  std::array<double, kSectors*(kSectors + 1) / 2> whitening_{};
};

}  // namespace tunnel_pilot::drivers
