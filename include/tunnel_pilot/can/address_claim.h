#pragma once

#include <cstdint>
#include <optional>

#include "tunnel_pilot/can/frame.h"
#include "tunnel_pilot/geometry/tick_time.h"

namespace tunnel_pilot::can {

/// Claims one J1939 address that was commissioned (SAE J1939-81): the claim with the NAME goes to all,
/// the address is held when nobody with a lower NAME answered for 250 ms. A claim of the same address
/// under a higher NAME, and a request for claims, are answered with the claim again. A lower NAME, or
/// the own one from elsewhere, takes the address for good: this is told once, from the null address,
/// after a time of up to 153 ms that depends on the NAME (losers would collide), and to whoever
/// requests. No other address is sought. Never more than one frame in kSpacing, whoever asks.
class AddressClaim {
 public:
  static constexpr Stamp kContention = std::chrono::milliseconds(250);
  static constexpr Stamp kSpacing = std::chrono::milliseconds(20);

  AddressClaim(std::uint8_t address, std::uint64_t name);

  /// Time goes on. `on_its_way`: a claim that the bus has taken is not proven to be sent; the contention
  /// begins when it is. A clock that jumps shortens no wait (TickTime).
  void tick(Stamp now, bool on_its_way);

  /// The frame to be sent now; sent() tells that the bus has taken it.
  std::optional<Frame> due() const;
  void sent();

  /// Takes in a claim or a request for claims. False: the frame is neither.
  bool hear(const Frame& frame);

  /// The bus was down, others may have come: claims anew. An address that was lost stays lost.
  void forget();

  bool held() const { return state_ == State::kHeld; }
  std::optional<std::uint64_t> lostTo() const { return lost_to_; }  ///< the winner's NAME

  /// The claim was not out after 1 s: nobody else is on the bus, or it does not work.
  bool overdue() const;

 private:
  enum class State { kUnclaimed, kContending, kHeld, kLost };

  void hearClaim(std::uint64_t name);
  Stamp shyness() const;

  std::uint8_t address_;
  std::uint64_t name_;
  State state_ = State::kUnclaimed;
  bool answer_ = false;  ///< somebody is to be told
  std::optional<std::uint64_t> lost_to_;
  TickTime time_;
  Stamp began_{};  ///< to claim
  Stamp since_{};  ///< contending, or owing an answer as the loser
  Stamp sent_at_ = -kSpacing;
};

}  // namespace tunnel_pilot::can
