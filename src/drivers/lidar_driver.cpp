#include "tunnel_pilot/drivers/lidar_driver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "tunnel_pilot/drivers/motion_history.h"

namespace tunnel_pilot::drivers {
namespace {

using neural::InputGroup;

// The members of TruckInputs by the names that a network's file gives them.
constexpr std::array<std::pair<const char*, double TruckInputs::*>, 5> kTruckInputs = {{
    {"articulation", &TruckInputs::articulation},
    {"articulation_ahead", &TruckInputs::articulation_ahead},
    {"speed", &TruckInputs::speed},
    {"yaw_gain", &TruckInputs::yaw_gain},
    {"yaw_disturbance", &TruckInputs::yaw_disturbance},
}};

double TruckInputs::*memberOf(const std::string& meaning) {
  for (const auto& [name, member] : kTruckInputs) {
    if (meaning == name) return member;
  }
  return nullptr;
}

double scaled(const InputGroup& group, double value) {
  value = std::clamp(value, group.min, group.max);
  return group.transform == InputGroup::Transform::kInverse ? group.scale / value
                                                            : (value - group.offset) / group.scale;
}

neural::GaussianCode codeOf(const neural::NetworkFile& file) {
  const neural::OutputGroup& output = file.output;
  if (output.meaning != "articulation_angle" || output.unit != "rad" ||
      output.code != neural::OutputGroup::Code::kGaussian) {
    throw config::ConfigError(file.name + ": its outputs are no Gaussian code of the articulation angle");
  }
  return {file.network.outputs(), output.first, output.spacing, output.width};
}

}  // namespace

LidarDriverParameters loadLidarDriver(config::Node node, const std::string& folder) {
  LidarDriverParameters p;
  p.network = (std::filesystem::path(folder) / node.text("network")).lexically_normal().string();
  p.speed = node.number("speed", "m/s", 0.1, 15.0);
  p.max_scan_age = node.number("max_scan_age", "s", 0.05, 1.0);
  p.steering = loadSteeringEstimator(node);
  node.finish();
  return p;
}

LidarInputs::LidarInputs(const std::vector<InputGroup>& groups, const std::string& source)
    : groups_(groups), inverse_(kBeams) {
  for (const InputGroup& group : groups) {
    const bool ranges = group.meaning == "ranges" && group.count == kBeams;
    const bool single = group.count == 1 && memberOf(group.meaning) != nullptr;
    if (!ranges && !single) {
      throw config::ConfigError(source + ": a lidar driver has no " + std::to_string(group.count) +
                                " inputs called '" + group.meaning + "'");
    }
    size_ += group.count;
  }
}

bool LidarInputs::fill(const std::vector<float>& ranges, const TruckInputs& truck, float* inputs) {
  if (ranges.size() != kBeams || !bridgeGaps(ranges)) return false;
  for (const InputGroup& group : groups_) {
    if (group.meaning == "ranges") {
      const auto scale = static_cast<float>(group.scale);
      const auto offset = static_cast<float>(group.offset);
      const auto lowest = static_cast<float>(1.0 / group.max);
      const auto highest = static_cast<float>(1.0 / std::max(group.min, 1e-3));
      const bool inverse = group.transform == InputGroup::Transform::kInverse;
      for (const float value : inverse_) {
        const float x = std::clamp(value, lowest, highest);
        *inputs++ = inverse ? scale * x : (1.0F / x - offset) / scale;
      }
    } else {
      const double value = truck.*memberOf(group.meaning);
      if (!std::isfinite(value)) return false;
      *inputs++ = static_cast<float>(scaled(group, value));
    }
  }
  return true;
}

// Between two returns 1/r runs linearly, as along a wall; before the first and behind the last it stays.
bool LidarInputs::bridgeGaps(const std::vector<float>& ranges) {
  std::size_t last = kBeams;  // none yet
  for (std::size_t i = 0; i < kBeams; ++i) {
    if (!std::isfinite(ranges[i]) || ranges[i] <= 0.0F) continue;
    inverse_[i] = 1.0F / ranges[i];
    if (last == kBeams) {
      std::fill_n(inverse_.begin(), i, inverse_[i]);
    } else if (i - last > 1) {
      const float step = (inverse_[i] - inverse_[last]) / static_cast<float>(i - last);
      for (std::size_t k = last + 1; k < i; ++k) {
        inverse_[k] = inverse_[last] + step * static_cast<float>(k - last);
      }
    }
    last = i;
  }
  if (last == kBeams) return false;
  std::fill(inverse_.begin() + static_cast<std::ptrdiff_t>(last) + 1, inverse_.end(), inverse_[last]);
  return true;
}

LidarDriver::LidarDriver(const LidarDriverParameters& parameters,
                         const vehicle::TruckGeometry& geometry, const neural::NetworkFile& network)
    : parameters_(parameters),
      inputs_(network.inputs, network.name),
      inference_(network.network),
      code_(codeOf(network)),
      steering_(parameters.steering, geometry),
      model_(network.name + " " + network.sha256),
      values_(inputs_.size()),
      outputs_(network.network.outputs()) {
  if (inputs_.size() != network.network.inputs()) {
    throw config::ConfigError(network.name + ": its inputs are not as many as its network takes");
  }
}

void LidarDriver::reset() { steering_.reset(); }

Proposal LidarDriver::propose(const geometry::Scan& scan, const Motion& motion, Stamp now) {
  Proposal proposal;
  proposal.stamp = scan.stamp;
  const Stamp age = now - scan.stamp;
  if (age < Stamp::zero() || toSeconds(age) > parameters_.max_scan_age) return proposal;
  if (!isFinite(motion)) return proposal;
  steering_.observe(motion);
  const double meets = steering_.articulationAhead(now);
  truck_ = {steering_.motion().articulation, meets, motion.speed, steering_.learned().gain,
            steering_.learned().disturbance};
  if (!inputs_.fill(scan.ranges, truck_, values_.data())) return proposal;
  inference_.run(values_.data(), outputs_.data());
  const neural::GaussianCode::Decoded decoded = code_.decode(outputs_.data());
  proposal.valid = decoded.peaks > 0;
  proposal.articulation_angle = steering_.give(decoded.value, meets, now);
  proposal.speed = parameters_.speed;
  proposal.confidence = decoded.confidence;
  return proposal;
}

}  // namespace tunnel_pilot::drivers
