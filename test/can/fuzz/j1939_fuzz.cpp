#include "j1939_fuzz.h"

#include <algorithm>
#include <memory>
#include <optional>

#include "tunnel_pilot/can/j1939_bus.h"

namespace tunnel_pilot::can {
namespace {

/// The wire below, of one frame a time in either direction.
struct Wire {
  std::optional<Frame> to_read;
  std::optional<Frame> sent;
  BusState state = BusState::kActive;
  std::uint64_t in_flight = 0;
  bool takes = true;
};

class WireBus : public Bus {
 public:
  explicit WireBus(Wire& wire) : wire_(wire) {}

  bool send(const Frame& frame) override {
    if (!wire_.takes) return false;
    require(!wire_.sent, "one frame a time");
    wire_.sent = frame;
    return true;
  }
  std::optional<Frame> receive() override {
    const std::optional<Frame> frame = wire_.to_read;
    wire_.to_read.reset();
    return frame;
  }
  std::uint64_t confirmed() const override { return 0; }
  std::uint64_t inFlight() const override { return wire_.in_flight; }
  BusState state() const override { return wire_.state; }
  int descriptor() const override { return -1; }

 private:
  Wire& wire_;
};

std::uint64_t nameOf(const Frame& frame) {
  std::uint64_t name = 0;
  for (std::size_t i = 8; i-- > 0;) name = name << 8 | frame.data[i];
  return name;
}

class Scene {
 public:
  explicit Scene(FuzzBytes& bytes) : bytes_(bytes) {
    parameters_.side = bytes.choice(2) == 0 ? Side::kPilot : Side::kTruck;
    parameters_.source_address = static_cast<std::uint8_t>(bytes.choice(kMaxAddress + 1));
    const std::size_t other = bytes.choice(kMaxAddress);
    parameters_.partner_address =
        static_cast<std::uint8_t>((parameters_.source_address + 1 + other) % 254);
    parameters_.name = bytes.take<std::uint64_t>();
    bus_ = std::make_unique<J1939Bus>(parameters_, std::make_unique<WireBus>(wire_));
  }

  void step() {
    switch (bytes_.choice(5)) {
      case 0:
        tick();
        break;
      case 1:
        hear();
        break;
      case 2:
        say();
        break;
      case 3:
        wire_.state = static_cast<BusState>(bytes_.choice(5));
        wire_.in_flight = bytes_.choice(2);
        wire_.takes = bytes_.choice(4) != 0;
        break;
      default:
        bus_->discard();
        break;
    }
    require(!lost_ || bus_->state() == BusState::kDown || bus_->state() == BusState::kBusOff,
            "a lost address is never used again");
  }

 private:
  // Steps of 10 ms and any others, back ones too; the claim has a time of its own.
  void tick() {
    const auto size = bytes_.take<std::int16_t>();
    const Stamp by = size % 2 == 0 ? Stamp(std::chrono::milliseconds(10)) : size * kFar;
    const Stamp next = std::clamp(now_ + by, -kFarthest, kFarthest);
    time_.tick(next);
    now_ = next;
    bus_->tick(now_);
    if (!wire_.sent) return;
    const J1939Id id = fromIdentifier(wire_.sent->id);
    require(wire_.sent->extended && wire_.sent->length == 8 && id.pgn == kAddressClaimedPgn,
            "time sends claims alone");
    require(nameOf(*wire_.sent) == parameters_.name, "a claim holds the own NAME");
    require(id.source == (lost_ ? kNullAddress : parameters_.source_address), "a claim's source");
    require(!said_at_ || time_.now() - *said_at_ >= AddressClaim::kSpacing, "one claim in 20 ms");
    said_at_ = time_.now();
    wire_.sent.reset();
  }

  Frame stranger() {
    const auto& groups = j1939Groups();
    J1939Id id;
    id.priority = static_cast<std::uint8_t>(bytes_.choice(8));
    const std::size_t kind = bytes_.choice(12);
    id.pgn = kind < 9     ? groups[kind].pgn
             : kind == 9  ? kAddressClaimedPgn
             : kind == 10 ? kRequestPgn
                          : bytes_.take<std::uint32_t>();
    const std::uint8_t addresses[] = {parameters_.source_address, parameters_.partner_address,
                                      kNullAddress, kGlobalAddress, bytes_.take<std::uint8_t>()};
    id.source = addresses[bytes_.choice(5)];
    id.destination = addresses[bytes_.choice(5)];
    Frame frame;
    frame.id = toIdentifier(id);
    require(toIdentifier(fromIdentifier(frame.id)) == frame.id,
            "an identifier goes to its parts and back");
    frame.extended = bytes_.choice(8) != 0;
    if (!frame.extended) frame.id &= 0x7FF;
    const std::size_t length = bytes_.choice(16);
    frame.length =
        static_cast<std::uint8_t>(kind == 10 && length > 8 ? 3 : std::min<std::size_t>(length, 8));
    bytes_.take(frame.data.data(), frame.data.size());
    if (kind == 10 && length > 9) frame.data = {0x00, 0xEE, 0x00};
    return frame;
  }

  void hear() {
    const Frame frame = stranger();
    wire_.to_read = frame;
    const J1939Id id = fromIdentifier(frame.id);
    const bool claim = frame.extended && id.pgn == kAddressClaimedPgn;
    if (claim && id.source == parameters_.source_address && frame.length == 8 &&
        nameOf(frame) <= parameters_.name) {
      lost_ = true;
    }
    const std::optional<Frame> got = bus_->receive();
    require(!claim || !got, "a claim is not handed up");
    if (!got || got->extended) return;
    require(frame.extended && got->data == frame.data && got->length == frame.length,
            "bytes go up unchanged");
    const auto& groups = j1939Groups();
    const auto* group =
        std::find_if(groups.begin(), groups.end(), [&](const J1939Group& g) { return g.id == got->id; });
    require(group != groups.end(), "what goes up is a frame of the .dbc");
    if (group->sender != parameters_.side) {
      require(id.source == parameters_.partner_address && id.pgn == group->pgn,
              "the partner's frames come from the partner's address");
    }
  }

  void say() {
    Frame frame;
    const std::size_t which = bytes_.choice(10);
    frame.id = which < 9 ? j1939Groups()[which].id : bytes_.take<std::uint16_t>() & 0x7FF;
    frame.length = 8;
    bytes_.take(frame.data.data(), frame.data.size());
    const bool open = bus_->state() != BusState::kDown;
    const bool went = bus_->send(frame);
    require(went == wire_.sent.has_value(), "send() tells whether the bus below took the frame");
    if (!went) return;
    const J1939Id id = fromIdentifier(wire_.sent->id);
    require(open || wire_.state == BusState::kDown, "nothing of the user's goes out before the claim");
    require(said_at_ && !lost_, "nothing of the user's goes out without the address");
    require(wire_.sent->extended && id.source == parameters_.source_address,
            "source of the user's frames");
    require(wire_.sent->data == frame.data && wire_.sent->length == 8, "bytes go out unchanged");
    wire_.sent.reset();
  }

  static constexpr Stamp kFar = Stamp(std::int64_t{1} << 30);  // 1 s
  static constexpr Stamp kFarthest = Stamp(std::int64_t{1} << 61);

  FuzzBytes& bytes_;
  J1939Parameters parameters_;
  Wire wire_;
  std::unique_ptr<J1939Bus> bus_;
  Stamp now_{};
  TickTime time_;  // of the claim
  bool lost_ = false;
  std::optional<Stamp> said_at_;
};

}  // namespace

void fuzzJ1939(FuzzBytes& bytes) {
  Scene scene(bytes);
  while (!bytes.empty()) scene.step();
}

}  // namespace tunnel_pilot::can
