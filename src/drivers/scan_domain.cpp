#include "tunnel_pilot/drivers/scan_domain.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tunnel_pilot/config/node.h"

namespace tunnel_pilot::drivers {
namespace {

constexpr double kQuantile = 0.999;
constexpr double kShare =
    0.6;  // of the quantile: so the fall beyond the limit begins within what is rare
// Added to each feature's variance: no scan is foreign for a few per cent that no training scan had.
constexpr double kDeviation = 0.03;
constexpr double kLeastInverse = 1e-6;  // [1/m]

using Matrix = Eigen::Matrix<double, ScanDomain::kSectors, ScanDomain::kSectors>;
using Vector = Eigen::Matrix<double, ScanDomain::kSectors, 1>;

Eigen::Map<const Vector> asVector(const ScanDomain::Features& features) {
  return Eigen::Map<const Vector>(features.data());
}

}  // namespace

ScanDomain::ScanDomain(const neural::InputDomain& domain, const std::string& source)
    : limit_(domain.limit) {
  if (domain.meaning != kMeaning || domain.mean.size() != mean_.size() ||
      domain.whitening.size() != whitening_.size()) {
    throw config::ConfigError(source + ": its domain is not that of a lidar driver's scans");
  }
  std::copy(domain.mean.begin(), domain.mean.end(), mean_.begin());
  std::copy(domain.whitening.begin(), domain.whitening.end(), whitening_.begin());
}

ScanDomain::Features ScanDomain::features(const std::vector<float>& inverse) {
  Features features{};
  for (std::size_t k = 0; k < kSectors; ++k) {
    const std::size_t begin = k * inverse.size() / kSectors;
    const std::size_t end = (k + 1) * inverse.size() / kSectors;
    double sum = 0.0;
    for (std::size_t i = begin; i < end; ++i) sum += static_cast<double>(inverse[i]);
    features[k] = std::log(std::max(sum / static_cast<double>(end - begin), kLeastInverse));
  }
  return features;
}

neural::InputDomain ScanDomain::fit(const std::vector<Features>& examples) {
  if (examples.size() < 10 * kSectors) throw std::invalid_argument("too few scans for a domain");
  const double count = static_cast<double>(examples.size());
  Vector mean = Vector::Zero();
  for (const Features& example : examples) mean += asVector(example) / count;
  Matrix covariance = kDeviation * kDeviation * Matrix::Identity();
  for (const Features& example : examples) {
    const Vector deviation = asVector(example) - mean;
    covariance += deviation * deviation.transpose() / count;
  }
  if (!covariance.allFinite()) throw std::invalid_argument("a scan of a domain is not finite");
  const Matrix lower = covariance.llt().matrixL();
  const Matrix whitening = lower.triangularView<Eigen::Lower>().solve(Matrix::Identity());
  neural::InputDomain domain{kMeaning, 1.0, {mean.data(), mean.data() + kSectors}, {}};
  for (Eigen::Index row = 0; row < whitening.rows(); ++row) {
    for (Eigen::Index column = 0; column <= row; ++column) {
      domain.whitening.push_back(whitening(row, column));
    }
  }
  std::vector<double> distances;
  distances.reserve(examples.size());
  const ScanDomain fitted(domain, "fit");
  for (const Features& example : examples) distances.push_back(fitted.distance(example));
  const auto last = static_cast<std::ptrdiff_t>(kQuantile * (count - 1.0));
  std::nth_element(distances.begin(), distances.begin() + last, distances.end());
  domain.limit = kShare * distances[static_cast<std::size_t>(last)];
  return domain;
}

double ScanDomain::distance(const Features& features) const {
  double sum = 0.0;
  const double* w = whitening_.data();
  for (std::size_t row = 0; row < kSectors; ++row) {
    double whitened = 0.0;
    for (std::size_t column = 0; column <= row; ++column) {
      whitened += *w++ * (features[column] - mean_[column]);
    }
    sum += whitened * whitened;
  }
  return sum;
}

double ScanDomain::familiarity(const std::vector<float>& inverse) const {
  const double d2 = distance(features(inverse));
  const double beyond = std::max(1.0, d2 / limit_);
  return 1.0 / (beyond * beyond);
}

}  // namespace tunnel_pilot::drivers
