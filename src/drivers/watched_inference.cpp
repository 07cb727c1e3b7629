#include "tunnel_pilot/drivers/watched_inference.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace tunnel_pilot::drivers {
namespace {

// Numbers in [-1, 1], spread so that each input's weights count.
std::vector<float> goldenInput(std::size_t size) {
  std::vector<float> input(size);
  for (std::size_t i = 0; i < size; ++i) {
    const double share = std::fmod(0.6180339887498949 * static_cast<double>(i + 1), 1.0);
    input[i] = static_cast<float>(2.0 * share - 1.0);
  }
  return input;
}

bool isPossible(float output) {
  return std::isfinite(output) && std::abs(output) <= WatchedInference::kLargestOutput;
}

}  // namespace

WatchedInference::WatchedInference(const neural::Network& network)
    : inference_(network),
      golden_input_(goldenInput(network.inputs())),
      golden_output_(network.outputs()),
      answer_(network.outputs()) {
  inference_.run(golden_input_.data(), golden_output_.data());
}

void WatchedInference::check(Stamp now) {
  if (checked_ && now >= *checked_ && now - *checked_ < kCheckPeriod) return;
  checked_ = now;
  inference_.run(golden_input_.data(), answer_.data());
  const std::size_t bytes = answer_.size() * sizeof(float);
  if (std::memcmp(answer_.data(), golden_output_.data(), bytes) != 0) corrupted_ = true;
}

WatchedInference::Health WatchedInference::run(const float* input, float* output, Stamp now) {
  check(now);
  if (corrupted_) return Health::kCorrupted;
  if (given_up_) return Health::kGivenUp;
  inference_.run(input, output);
  const bool refused = !std::all_of(output, output + inference_.outputs(), isPossible);
  refused_ = refused_ << 1U;
  refused_[0] = refused;
  given_up_ = refused_.count() >= kMostRefused;
  if (given_up_) return Health::kGivenUp;
  return refused ? Health::kOutputRefused : Health::kGood;
}

void WatchedInference::reset() {
  refused_.reset();
  given_up_ = false;
}

}  // namespace tunnel_pilot::drivers
