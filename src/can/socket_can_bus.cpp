#include "tunnel_pilot/can/socket_can_bus.h"

#include <linux/can/error.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace tunnel_pilot::can {

SocketCanBus::SocketCanBus(std::string interface, std::vector<Identifier> listen,
                           std::unique_ptr<CanSocket> socket)
    : interface_(std::move(interface)), listen_(std::move(listen)), socket_(std::move(socket)) {
  takeLink(socket_->link());
  interrupted_ = false;
}

// -------- sending

bool SocketCanBus::send(const Frame& frame) {
  if (state() == BusState::kBusOff || state() == BusState::kDown) return false;
  const int error = socket_->send(frame);
  if (error == 0) {
    ++in_flight_;
    return true;
  }
  // A full queue in which some of ours wait: they would come late.
  if (error == ENOBUFS && in_flight_ > 0) stuck_ = true;
  takeError(error);
  return false;
}

void SocketCanBus::discard() {
  const bool needed = bus_off_ || stuck_ || in_flight_ > 0;
  if (!open_ || !link_.up || !needed) return;
  discarding_ = true;
  if (socket_->cycle().stage == LinkCycle::Stage::kRunning) return;
  if (!socket_->startCycle()) takeCycle();
}

// -------- receiving

std::optional<Frame> SocketCanBus::receive() {
  if (read_out_) interrupted_ = false;
  read_out_ = false;
  while (open_) {
    const Received received = socket_->receive();
    if (const auto frame = take(received)) return frame;
    if (received.kind == Received::Kind::kNothing || received.kind == Received::Kind::kError) break;
  }
  watchLink();
  takeCycle();
  read_out_ = true;
  return std::nullopt;
}

std::optional<Frame> SocketCanBus::take(const Received& received) {
  switch (received.kind) {
    case Received::Kind::kFrame:
      if (listensTo(received.frame)) return received.frame;
      ++discarded_;
      break;
    case Received::Kind::kOther:
      ++discarded_;
      break;
    case Received::Kind::kEcho:
      takeEcho();
      break;
    case Received::Kind::kErrorFrame:
      takeErrorFrame(received.frame);
      break;
    case Received::Kind::kError:
      takeError(received.error);
      break;
    default:  // nothing
      break;
  }
  return std::nullopt;
}

bool SocketCanBus::listensTo(const Frame& frame) const {
  return std::any_of(listen_.begin(), listen_.end(),
                     [&](const Identifier& identifier) { return matches(identifier, frame); });
}

void SocketCanBus::takeEcho() {
  ++confirmed_;
  if (in_flight_ == 0 || discarding_) ++late_;
  if (in_flight_ > 0) --in_flight_;
}

void SocketCanBus::takeErrorFrame(const Frame& frame) {
  if ((frame.id & CAN_ERR_BUSOFF) != 0) bus_off_ = true;
  if ((frame.id & CAN_ERR_TX_TIMEOUT) != 0) stuck_ = true;
  if ((frame.id & CAN_ERR_CRTL) == 0) return;
  const std::uint8_t detail = frame.data[1];
  if ((detail & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    link_.state = BusState::kPassive;
  } else if ((detail & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
    link_.state = BusState::kWarning;
  } else if ((detail & CAN_ERR_CRTL_ACTIVE) != 0) {
    link_.state = BusState::kActive;
  }
}

void SocketCanBus::takeError(int error) {
  switch (error) {
    case ENXIO:
    case ENODEV:
      socket_->close();
      open_ = false;
      [[fallthrough]];
    case ENETDOWN:
      emptied();
      takeLink(socket_->link());
      break;
    default:
      break;
  }
}

// -------- the link

void SocketCanBus::watchLink() {
  while (const auto change = socket_->nextChange()) takeLink(*change);
}

void SocketCanBus::takeLink(const CanLink& link) {
  link_ = link;
  if (!link_.present && open_) {
    socket_->close();
    open_ = false;
  }
  if (link_.present && !open_) {
    open_error_ = socket_->open(listen_);
    open_ = open_error_ == 0;
    link_ = socket_->link();  // what it was when we heard of it may be over
  }
  if (!link_.up) emptied();
  if (link_.up && link_.controller && (link_.state == BusState::kBusOff || !link_.carrier)) {
    bus_off_ = true;
  }
}

// A link that is down, or gone, holds no frame of ours any more.
void SocketCanBus::emptied() {
  in_flight_ = 0;
  bus_off_ = stuck_ = discarding_ = false;
  interrupted_ = true;
  helper_failed_.clear();
}

void SocketCanBus::takeCycle() {
  const LinkCycle cycle = socket_->cycle();
  if (!discarding_) return;
  if (cycle.stage == LinkCycle::Stage::kFailed) helper_failed_ = cycle.why;
  if (cycle.stage != LinkCycle::Stage::kDone) return;
  watchLink();  // the helper is done after all that it did has been told
  if (!discarding_) return;
  emptied();  // the tale was lost
  takeLink(socket_->link());
}

bool SocketCanBus::usable() const {
  return !link_.controller || (link_.restart_ms == 0 && link_.echoes);
}

BusState SocketCanBus::state() const {
  if (!open_ || !link_.up || interrupted_ || !usable()) return BusState::kDown;
  if (bus_off_) return BusState::kBusOff;
  if (stuck_ || discarding_) return BusState::kDown;
  return link_.state;
}

std::string SocketCanBus::trouble() const {
  if (state() != BusState::kDown && state() != BusState::kBusOff) return "";
  const std::string set = "ip link set " + interface_;
  if (!link_.present) return "there is no interface " + interface_;
  if (!open_) return interface_ + " cannot be opened: " + std::strerror(open_error_);
  if (!link_.up && link_.controller && !link_.configured) {
    return interface_ + " has no bit rate: " + set + " type can bitrate BITRATE restart-ms 0; " + set +
           " up";
  }
  if (!link_.up) return interface_ + " is down: " + set + " up";
  if (link_.controller && link_.restart_ms != 0) {
    return interface_ + " restarts itself when bus-off and would send old frames: " + set + " down; " +
           set + " type can restart-ms 0; " + set + " up";
  }
  if (!usable()) return "the driver of " + interface_ + " does not echo what was sent: use another";
  if (!bus_off_ && !stuck_ && !discarding_) return "";
  std::string what = "frames are stuck in the queue of " + interface_;
  if (bus_off_) what = interface_ + " is bus-off";
  if (helper_failed_.empty()) return what;
  return what + ", can_link_cycle failed (" + helper_failed_ + "): " + set + " down; " + set + " up";
}

}  // namespace tunnel_pilot::can
