#include "tunnel_pilot/can/j1939_bus.h"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace tunnel_pilot::can {
namespace {

constexpr std::uint32_t kAllButPriority = 0x03FFFFFF;
constexpr std::uint32_t kAnySource = 0x03FFFF00;
constexpr std::uint32_t kSourceOnly = 0xFF;

template <class Member, class Value>
const J1939Group* findGroup(Member member, Value value) {
  const auto& groups = j1939Groups();
  const auto found = std::find_if(groups.begin(), groups.end(),
                                  [&](const J1939Group& group) { return group.*member == value; });
  return found == groups.end() ? nullptr : &*found;
}

bool works(const Bus& bus) { return bus.state() != BusState::kDown && bus.state() != BusState::kBusOff; }

std::string hexadecimal(unsigned long long number) {
  char text[24];
  std::snprintf(text, sizeof text, "0x%016llX", number);
  return text;
}

}  // namespace

J1939Bus::J1939Bus(const J1939Parameters& parameters, std::unique_ptr<Bus> bus)
    : parameters_(parameters),
      bus_(std::move(bus)),
      claim_(parameters.source_address, parameters.name) {}

void J1939Bus::tick(Stamp now) {
  bus_->tick(now);
  if (!works(*bus_)) claim_.forget();
  claim_.tick(now, bus_->inFlight() > 0);
  const std::optional<Frame> frame = claim_.due();
  if (frame && bus_->send(*frame)) claim_.sent();
}

bool J1939Bus::send(const Frame& frame) {
  const J1939Group* group = findGroup(&J1939Group::id, frame.id);
  if (!claim_.held() || frame.extended || group == nullptr || group->sender != parameters_.side) {
    return false;
  }
  Frame out = frame;
  out.id = toIdentifier({group->priority, group->pgn, kGlobalAddress, parameters_.source_address});
  out.extended = true;
  return bus_->send(out);
}

std::optional<Frame> J1939Bus::receive() {
  while (const std::optional<Frame> frame = bus_->receive()) {
    if (!frame->extended || !claim_.hear(*frame)) return handedUp(*frame);
  }
  return std::nullopt;
}

Frame J1939Bus::handedUp(Frame frame) const {
  const bool plain = !frame.extended;
  frame.extended = true;
  if (plain) return frame;
  const J1939Id id = fromIdentifier(frame.id);
  const J1939Group* group = findGroup(&J1939Group::pgn, id.pgn);
  const bool our_group = group != nullptr && group->sender == parameters_.side;
  const bool our_address = id.source == parameters_.source_address;
  const bool partners = group != nullptr && id.source == parameters_.partner_address;
  if (our_address && !our_group) group = findGroup(&J1939Group::sender, parameters_.side);
  if (!our_group && !our_address && !partners) return frame;
  frame.id = group->id;
  frame.extended = false;
  return frame;
}

// The queue may hold a claim that waits for somebody to hear it, and harms nobody.
void J1939Bus::discard() {
  if (claim_.held() || !works(*bus_)) bus_->discard();
}

BusState J1939Bus::state() const {
  return claim_.held() || !works(*bus_) ? bus_->state() : BusState::kDown;
}

std::string J1939Bus::trouble() const {
  std::string below = bus_->trouble();
  if (!below.empty()) return below;
  const std::string address = "J1939 address " + std::to_string(parameters_.source_address);
  if (const auto winner = claim_.lostTo()) {
    return address + " is lost to NAME " + hexadecimal(*winner) +
           ": give one of the two another address, then start anew";
  }
  if (!claim_.overdue()) return "";
  return address + " is not claimed: nobody hears the claim, or it is contended";
}

std::vector<Identifier> j1939Identifiers(const J1939Parameters& parameters) {
  const auto of = [](std::uint32_t pgn, std::uint8_t destination, std::uint8_t source,
                     std::uint32_t mask) {
    return Identifier{toIdentifier({0, pgn, destination, source}) & mask, true, mask};
  };
  const std::uint8_t own = parameters.source_address;
  std::vector<Identifier> identifiers = {
      of(0, 0, own, kSourceOnly),  // echoes, contention, foreign senders
      of(kAddressClaimedPgn, kGlobalAddress, kNullAddress, kAllButPriority),  // echo of the loser's
      of(kRequestPgn, kGlobalAddress, 0, kAnySource), of(kRequestPgn, own, 0, kAnySource)};
  for (const J1939Group& group : j1939Groups()) {
    identifiers.push_back(group.sender == parameters.side
                              ? of(group.pgn, 0, 0, kAnySource)
                              : of(group.pgn, 0, parameters.partner_address, kAllButPriority));
  }
  return identifiers;
}

}  // namespace tunnel_pilot::can
