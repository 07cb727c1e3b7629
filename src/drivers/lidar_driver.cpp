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
constexpr std::array<std::pair<const char*, double TruckInputs::*>, 6> kTruckInputs = {{
    {"articulation", &TruckInputs::articulation},
    {"articulation_ahead", &TruckInputs::articulation_ahead},
    {"speed", &TruckInputs::speed},
    {"yaw_gain", &TruckInputs::yaw_gain},
    {"yaw_disturbance", &TruckInputs::yaw_disturbance},
    {"steering_rate", &TruckInputs::steering_rate},
}};

double TruckInputs::*memberOf(const std::string& meaning) {
  for (const auto& [name, member] : kTruckInputs) {
    if (meaning == name) return member;
  }
  return nullptr;
}

std::optional<neural::GaussianCode> codeOf(const neural::NetworkFile& file) {
  const neural::OutputGroup& output = file.output;
  const bool coded = output.code == neural::OutputGroup::Code::kGaussian;
  const std::size_t outputs = file.network.outputs();
  if (output.meaning != "articulation_angle" || output.unit != "rad" || (!coded && outputs != 1)) {
    throw config::ConfigError(file.name + ": its outputs do not tell an articulation angle");
  }
  if (!coded) return std::nullopt;
  return neural::GaussianCode(outputs, output.first, output.spacing, output.width);
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
  p.mirror = node.boolean("mirror");
  p.sure = node.number("sure", "1", 0.0, 1.0);
  p.bridge_time = node.number("bridge_time", "s", 0.0, 0.5);
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
  for (const auto& [name, member] : kTruckInputs) {
    if (!std::isfinite(truck.*member)) return false;
  }
  truck_ = truck;
  write(inverse_.begin(), inverse_.end(), truck, inputs);
  return true;
}

void LidarInputs::fillMirrored(float* inputs) const {
  const TruckInputs mirrored{-truck_.articulation, -truck_.articulation_ahead, truck_.speed,
                             truck_.yaw_gain,      -truck_.yaw_disturbance,    truck_.steering_rate};
  write(inverse_.rbegin(), inverse_.rend(), mirrored, inputs);
}

template <typename Iterator>
void LidarInputs::write(Iterator first, Iterator last, const TruckInputs& truck, float* inputs) const {
  for (const InputGroup& group : groups_) {
    if (double TruckInputs::*const member = memberOf(group.meaning)) {
      *inputs++ = static_cast<float>(group.scaled(truck.*member));
      continue;
    }
    const auto scale = static_cast<float>(group.scale);
    const auto offset = static_cast<float>(group.offset);
    const auto lowest = static_cast<float>(1.0 / group.max);
    const auto highest = static_cast<float>(1.0 / std::max(group.min, 1e-3));
    const bool inverse = group.transform == InputGroup::Transform::kInverse;
    for (Iterator beam = first; beam != last; ++beam) {
      const float x = std::clamp(*beam, lowest, highest);
      *inputs++ = inverse ? scale * x : (1.0F / x - offset) / scale;
    }
  }
}

LidarDriver::LidarDriver(const LidarDriverParameters& parameters, const vehicle::TruckGeometry& geometry,
                         const neural::NetworkFile& network)
    : parameters_(parameters),
      inputs_(network.inputs, network.name),
      inference_(network.network),
      output_(network.output),
      code_(codeOf(network)),
      domain_(domainOf(network)),
      steering_(parameters.steering, geometry),
      model_(network.name + " " + network.sha256),
      values_(inputs_.size()),
      outputs_(network.network.outputs()),
      mirrored_(network.network.outputs()) {
  if (inputs_.size() != network.network.inputs()) {
    throw config::ConfigError(network.name + ": its inputs are not as many as its network takes");
  }
}

void LidarDriver::reset() {
  steering_.reset();
  inference_.reset();
  last_sure_stamp_.reset();
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
  if (!isUsable(motion)) return Refusal::kMotion;
  steering_.observe(motion);
  const double meets = steering_.articulationAhead(now);
  truck_ = {steering_.motion().articulation,
            meets,
            motion.speed,
            steering_.learned().gain,
            steering_.learned().disturbance,
            steering_.maxRate()};
  if (!inputs_.fill(scan.ranges, truck_, values_.data())) return Refusal::kScan;
  const Refusal refused = ask(now);
  if (refused != Refusal::kNone) return refused;
  std::optional<Answer> answer = decode();
  if (!answer) return Refusal::kNoBell;
  if (domain_) answer->confidence *= domain_->familiarity(inputs_.inverse());
  *answer = bridged(*answer, scan.stamp);
  proposal.articulation_angle =
      steering_.give(meets + softened(answer->articulation - meets), meets, now);
  proposal.speed = parameters_.speed;
  proposal.confidence = answer->confidence;
  return Refusal::kNone;
}

// The network's outputs, averaged with those for the mirrored scan where that is wanted.
LidarDriver::Refusal LidarDriver::ask(Stamp now) {
  const auto run = [&](std::vector<float>& outputs) {
    switch (inference_.run(values_.data(), outputs.data(), now)) {
      case WatchedInference::Health::kOutputRefused:
        return Refusal::kOutputs;
      case WatchedInference::Health::kGivenUp:
        return Refusal::kGivenUp;
      case WatchedInference::Health::kCorrupted:
        return Refusal::kCorrupted;
      case WatchedInference::Health::kGood:
        break;
    }
    return Refusal::kNone;
  };
  const Refusal refused = run(outputs_);
  if (refused != Refusal::kNone || !parameters_.mirror) return refused;
  inputs_.fillMirrored(values_.data());
  const Refusal mirror_refused = run(mirrored_);
  const float sign = code_ ? 1.0F : -1.0F;  // an angle changes its sign in a mirror
  const float shift = code_ ? 0.0F : static_cast<float>(2.0 * output_.offset / output_.scale);
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    outputs_[i] = 0.5F * (outputs_[i] + sign * mirrored_[mirrored_.size() - 1 - i] - shift);
  }
  return mirror_refused;
}

std::optional<LidarDriver::Answer> LidarDriver::decode() const {
  if (!code_) return Answer{output_.offset + output_.scale * static_cast<double>(outputs_[0]), 1.0};
  const neural::GaussianCode::Decoded decoded = code_->decode(outputs_.data());
  if (decoded.peaks == 0) return std::nullopt;
  return Answer{decoded.value, decoded.confidence};
}

// Answered as sharply as the plan does that the network has learned from, small errors make trucks swing
// whose steering is slower or later than believed. Great ones are up to the steering's fastest rate.
double LidarDriver::softened(double lead) const {
  const double used = std::min(1.0, std::abs(lead) / parameters_.steering.lead);
  return lead * (output_.small_lead_share + (1.0 - output_.small_lead_share) * used);
}

LidarDriver::Answer LidarDriver::bridged(const Answer& answer, Stamp stamp) {
  if (answer.confidence >= parameters_.sure) {
    last_sure_ = answer;
    last_sure_stamp_ = stamp;
    return answer;
  }
  const bool fresh = last_sure_stamp_ && stamp >= *last_sure_stamp_ &&
                     toSeconds(stamp - *last_sure_stamp_) <= parameters_.bridge_time;
  return fresh ? last_sure_ : answer;
}

std::string toString(LidarDriver::Refusal refusal) {
  using Refusal = LidarDriver::Refusal;
  switch (refusal) {
    case Refusal::kNone:
      return "none";
    case Refusal::kScanAge:
      return "no fresh scan";
    case Refusal::kMotion:
      return "motion feedback is not finite or beyond 1e6";
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
