#include "tunnel_pilot/can/address_claim.h"

#include "tunnel_pilot/can/j1939.h"

namespace tunnel_pilot::can {
namespace {

constexpr Stamp kOverdue = std::chrono::seconds(1);
constexpr Stamp kShynessStep = std::chrono::microseconds(600);
constexpr std::uint8_t kRequestLength = 3;

std::uint64_t littleEndian(const Frame& frame) {
  std::uint64_t number = 0;
  for (std::size_t i = frame.data.size(); i-- > 0;) number = number << 8 | frame.data[i];
  return number;
}

Frame claimFrame(std::uint8_t source, std::uint64_t name) {
  Frame frame;
  frame.id = toIdentifier({6, kAddressClaimedPgn, kGlobalAddress, source});
  frame.extended = true;
  frame.length = 8;
  for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(name >> 8 * i);
  return frame;
}

}  // namespace

AddressClaim::AddressClaim(std::uint8_t address, std::uint64_t name) : address_(address), name_(name) {}

void AddressClaim::tick(Stamp now, bool on_its_way) {
  time_.tick(now);
  if (state_ != State::kContending) return;
  if (on_its_way) since_ = time_.now();
  if (time_.now() - since_ >= kContention) state_ = State::kHeld;
}

std::optional<Frame> AddressClaim::due() const {
  if (time_.now() - sent_at_ < kSpacing) return std::nullopt;
  if (state_ == State::kUnclaimed) return claimFrame(address_, name_);
  if (!answer_) return std::nullopt;
  if (state_ == State::kLost) {
    if (time_.now() - since_ < shyness()) return std::nullopt;
    return claimFrame(kNullAddress, name_);
  }
  return claimFrame(address_, name_);
}

void AddressClaim::sent() {
  answer_ = false;
  sent_at_ = time_.now();
  if (state_ == State::kLost || state_ == State::kHeld) return;
  state_ = State::kContending;
  since_ = time_.now();
}

bool AddressClaim::hear(const Frame& frame) {
  const J1939Id id = fromIdentifier(frame.id);
  if (id.pgn == kAddressClaimedPgn) {
    if (id.source == address_ && frame.length == 8) hearClaim(littleEndian(frame));
    return true;
  }
  const bool for_us = id.destination == kGlobalAddress || id.destination == address_;
  const bool request = id.pgn == kRequestPgn && for_us && frame.length == kRequestLength &&
                       (littleEndian(frame) & 0xFFFFFF) == kAddressClaimedPgn;
  if (!request || id.source == address_) return false;
  if (state_ == State::kLost && !answer_) since_ = time_.now();
  answer_ = true;
  return true;
}

void AddressClaim::hearClaim(std::uint64_t name) {
  if (state_ == State::kLost) return;
  answer_ = true;
  if (name > name_) return;
  lost_to_ = name;
  state_ = State::kLost;
  since_ = time_.now();
}

void AddressClaim::forget() {
  began_ = time_.now();
  if (state_ != State::kLost) state_ = State::kUnclaimed;
}

bool AddressClaim::overdue() const {
  const bool claims = state_ == State::kUnclaimed || state_ == State::kContending;
  return claims && time_.now() - began_ >= kOverdue;
}

// Bytes of the NAME as the pseudo-random number that the standard asks for: the same in every run.
Stamp AddressClaim::shyness() const {
  std::uint8_t sum = 0;
  for (int i = 0; i < 64; i += 8) sum = static_cast<std::uint8_t>(sum + (name_ >> i & 0xFF));
  return kShynessStep * sum;
}

}  // namespace tunnel_pilot::can
