#include "tunnel_pilot/drivers/lidar_driver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "tunnel_pilot/drivers/inverse_ranges.h"
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
    throw config::ConfigError(file.name +
                              ": its outputs are no Gaussian code of the articulation angle");
  }
  return {file.network.outputs(), output.first, output.spacing, output.width};
}

std::optional<ScanDomain> domainOf(const neural::NetworkFile& file) {
  if (!file.domain) return std::nullopt;
  return ScanDomain(*file.domain, file.name);
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
  if (ranges.size() != kBeams || !invertRanges(ranges, inverse_)) return false;
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

LidarDriver::LidarDriver(const LidarDriverParameters& parameters, const vehicle::TruckGeometry& geometry,
                         const neural::NetworkFile& network)
    : parameters_(parameters),
      inputs_(network.inputs, network.name),
      inference_(network.network),
      code_(codeOf(network)),
      domain_(domainOf(network)),
      steering_(parameters.steering, geometry),
      model_(network.name + " " + network.sha256),
      values_(inputs_.size()),
      outputs_(network.network.outputs()) {
  if (inputs_.size() != network.network.inputs()) {
    throw config::ConfigError(network.name + ": its inputs are not as many as its network takes");
  }
}

void LidarDriver::reset() {
  steering_.reset();
  inference_.reset();
}

Proposal LidarDriver::propose(const geometry::Scan& scan, const Motion& motion, Stamp now) {
  Proposal proposal;
  proposal.stamp = scan.stamp;
  refusal_ = steer(scan, motion, now, proposal);
  proposal.valid = refusal_ == Refusal::kNone;
  return proposal;
}

LidarDriver::Refusal LidarDriver::steer(const geometry::Scan& scan, const Motion& motion, Stamp now,
                                        Proposal& proposal) {
  const Stamp age = now - scan.stamp;
  if (age < Stamp::zero() || toSeconds(age) > parameters_.max_scan_age) return Refusal::kScanAge;
  if (!isFinite(motion)) return Refusal::kMotion;
  steering_.observe(motion);
  const double meets = steering_.articulationAhead(now);
  truck_ = {steering_.motion().articulation, meets, motion.speed, steering_.learned().gain,
            steering_.learned().disturbance};
  if (!inputs_.fill(scan.ranges, truck_, values_.data())) return Refusal::kScan;
  switch (inference_.run(values_.data(), outputs_.data(), now)) {
    case WatchedInference::Health::kOutputRefused:
      return Refusal::kOutputs;
    case WatchedInference::Health::kGivenUp:
      return Refusal::kGivenUp;
    case WatchedInference::Health::kCorrupted:
      return Refusal::kCorrupted;
    case WatchedInference::Health::kGood:
      break;
  }
  const neural::GaussianCode::Decoded decoded = code_.decode(outputs_.data());
  if (decoded.peaks == 0) return Refusal::kNoBell;
  proposal.articulation_angle = steering_.give(decoded.value, meets, now);
  proposal.speed = parameters_.speed;
  proposal.confidence = decoded.confidence * (domain_ ? domain_->familiarity(inputs_.inverse()) : 1.0);
  return Refusal::kNone;
}

std::string toString(LidarDriver::Refusal refusal) {
  using Refusal = LidarDriver::Refusal;
  switch (refusal) {
    case Refusal::kNone:
      return "none";
    case Refusal::kScanAge:
      return "no fresh scan";
    case Refusal::kMotion:
      return "motion feedback is not finite";
    case Refusal::kScan:
      return "the scan has no 761 beams or no return";
    case Refusal::kOutputs:
      return "the network's outputs are impossible";
    case Refusal::kGivenUp:
      return "the network's outputs were impossible again and again: it is no longer listened to";
    case Refusal::kCorrupted:
      return "the network failed its self check: its parameters in memory are corrupt";
    case Refusal::kNoBell:
      return "the network shows no direction";
  }
  return "unknown";
}

}  // namespace tunnel_pilot::drivers
