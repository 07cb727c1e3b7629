#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tunnel_pilot/can/address_claim.h"
#include "tunnel_pilot/can/bus.h"
#include "tunnel_pilot/can/can_socket.h"
#include "tunnel_pilot/can/j1939.h"

namespace tunnel_pilot::can {

/// Who one is on a J1939 network, and whom one talks to.
struct J1939Parameters {
  Side side = Side::kPilot;
  std::uint8_t source_address = 0;   ///< to be claimed
  std::uint8_t partner_address = 0;  ///< of the other side
  std::uint64_t name = 0;            ///< toNumber()
};

/// A bus that speaks J1939 (SAE J1939-21, -81) on the wire and the frames of the .dbc with their 11-bit
/// identifiers to whoever uses it; bytes are the same in both. Nothing of its user's is sent before the
/// address is claimed, nor after it is lost: send() is refused and state() tells kDown, which never
/// changes again once it is lost; trouble() says to whom. It claims anew after `bus` was down.
///
/// receive() gives the partner's frames, and as a foreign sender's (under an identifier that its user
/// sends): a frame of the own groups from any address, and any other frame from the own address, but for
/// claims. All else comes as a 29-bit frame, which its user does not know, and counts so. Priorities are
/// not looked at.
class J1939Bus : public Bus {
 public:
  J1939Bus(const J1939Parameters& parameters, std::unique_ptr<Bus> bus);

  void tick(Stamp now) override;
  bool send(const Frame& frame) override;
  std::optional<Frame> receive() override;
  std::uint64_t confirmed() const override { return bus_->confirmed(); }
  std::uint64_t inFlight() const override { return bus_->inFlight(); }
  void discard() override;
  BusState state() const override;
  std::string trouble() const override;
  int descriptor() const override { return bus_->descriptor(); }

 private:
  Frame handedUp(Frame frame) const;

  J1939Parameters parameters_;
  std::unique_ptr<Bus> bus_;
  AddressClaim claim_;
};

/// What a J1939Bus must hear, its own echoes included.
std::vector<Identifier> j1939Identifiers(const J1939Parameters& parameters);

}  // namespace tunnel_pilot::can
