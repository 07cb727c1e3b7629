#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <vector>

#include "tunnel_pilot/geometry/time.h"
#include "tunnel_pilot/neural/inference.h"

namespace tunnel_pilot::drivers {

/// Runs a network and watches over it, for a network may be wrong, but must not be silently so:
/// - every kCheckPeriod it is given the golden input that it was given when it was made, and must answer
///   with the same bits. When it does not, its parameters were spoilt in memory: it never runs again.
/// - outputs that are not finite or of a magnitude beyond kLargestOutput are refused (probabilities are
///   at most 1, scaled values hardly more); after kMostRefused of the last kRemembered runs it gives up
///   until reset().
/// Allocates nothing after construction.
class WatchedInference {
 public:
  static constexpr Stamp kCheckPeriod = std::chrono::seconds(60);
  static constexpr float kLargestOutput = 2.0F;
  static constexpr std::size_t kRemembered = 10;
  static constexpr std::size_t kMostRefused = 3;

  enum class Health : std::uint8_t { kGood, kOutputRefused, kGivenUp, kCorrupted };

  explicit WatchedInference(const neural::Network& network);

  /// As neural::Inference::run; `output` may be used when the answer is kGood.
  Health run(const float* input, float* output, Stamp now);

  /// Forgets refused outputs. What was corrupted stays so.
  void reset();

 private:
  friend struct WatchedInferenceAccess;  // a test that spoils parameters

  void check(Stamp now);

  neural::Inference inference_;
  std::vector<float> golden_input_;
  std::vector<float> golden_output_;
  std::vector<float> answer_;
  std::optional<Stamp> checked_;
  bool corrupted_ = false;
  std::bitset<kRemembered> refused_;  ///< of the last runs
  bool given_up_ = false;
};

}  // namespace tunnel_pilot::drivers
