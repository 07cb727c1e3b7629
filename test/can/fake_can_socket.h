#pragma once

#include <linux/can/error.h>

#include <cerrno>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tunnel_pilot/can/can_socket.h"

namespace tunnel_pilot::can {

/// What a kernel and its controller do with a SocketCAN interface, as it was measured on an emulated
/// machine (docs/can_machine.md): the queue of ten frames, the silence of a bus-off controller, what a
/// stalled one does when it goes on, and which call gets which error.
class FakeKernel {
 public:
  static constexpr std::size_t kQueueLength = 10;

  FakeKernel() {
    link.present = link.up = link.carrier = link.controller = link.echoes = link.configured = true;
  }

  // -------- faults

  void stall() { stalled = true; }  ///< the controller sends nothing, and says nothing

  /// It goes on: all that waited comes in one burst.
  void release() {
    stalled = false;
    while (!queue.empty()) transmit(pop());
  }

  void busOff() {
    stalled = true;
    link.state = BusState::kBusOff;
    link.carrier = false;
    told(CAN_ERR_BUSOFF);
  }

  void down() {
    link.up = link.carrier = false;
    link.state = BusState::kDown;
    queue.clear();
    inbox.push_back(error(ENETDOWN));
    changes.push_back(link);
  }

  void up() {
    link.up = link.carrier = true;
    link.state = BusState::kActive;
    stalled = broken;
    changes.push_back(link);
  }

  void unplug() {
    link = CanLink();
    queue.clear();
    inbox.clear();
    inbox.push_back(error(ENODEV));
    changes.push_back(link);
    attached = false;
  }

  /// Back, as a device comes: not configured and down.
  void plug() {
    link.present = link.controller = link.echoes = true;
    changes.push_back(link);
  }

  void configure() {
    link.configured = true;
    up();
  }

  void told(std::uint32_t error_class, std::uint8_t detail = 0) {
    Received r;
    r.kind = Received::Kind::kErrorFrame;
    r.frame.id = error_class;
    r.frame.data[1] = detail;
    inbox.push_back(r);
  }

  void hear(const Frame& frame) { inbox.push_back({Received::Kind::kFrame, frame, 0}); }

  void transmit(const Frame& frame) {
    sent.push_back(frame);
    inbox.push_back({Received::Kind::kEcho, frame, 0});
    if (wire != nullptr) wire->send(frame);
  }

  static Received error(int number) { return {Received::Kind::kError, Frame(), number}; }

  CanLink link;
  bool stalled = false;
  bool broken = false;    ///< stays so whatever is done
  bool attached = false;  ///< the socket is bound to the device that is there
  std::deque<Frame> queue;
  std::deque<Received> inbox;
  std::deque<CanLink> changes;
  std::vector<Frame> sent;  ///< what really went out
  std::vector<Identifier> listen;
  Bus* wire = nullptr;  ///< where it goes
  int opened = 0;
  int writes = 0;  ///< calls of send()

  int open_error = 0;          ///< errno of the next open()
  std::string helper_missing;  ///< why it cannot be started; empty: it can
  std::string helper_fails;    ///< why; empty: it works
  int helper_steps = 3;        ///< looks until it is done
  bool silent_cycle = false;   ///< neither the socket nor netlink tells of what the helper did
  int cycles = 0;              ///< starts of the helper

 private:
  Frame pop() {
    const Frame frame = queue.front();
    queue.pop_front();
    return frame;
  }
};

class FakeCanSocket : public CanSocket {
 public:
  explicit FakeCanSocket(FakeKernel& kernel) : kernel_(kernel) {}

  int open(const std::vector<Identifier>& listen) override {
    if (!kernel_.link.present) return ENODEV;
    if (kernel_.open_error != 0) return kernel_.open_error;
    kernel_.listen = listen;
    kernel_.inbox.clear();
    kernel_.attached = true;
    ++kernel_.opened;
    return 0;
  }
  void close() override { kernel_.attached = false; }

  int send(const Frame& frame) override {
    ++kernel_.writes;
    if (!kernel_.attached) return ENXIO;
    if (!kernel_.link.up) return ENETDOWN;
    if (!kernel_.stalled) return kernel_.transmit(frame), 0;
    if (kernel_.queue.size() >= FakeKernel::kQueueLength) return ENOBUFS;
    kernel_.queue.push_back(frame);  // bus-off, too: it returns success
    return 0;
  }

  Received receive() override {
    if (kernel_.inbox.empty() && kernel_.wire != nullptr) {
      if (const auto frame = kernel_.wire->receive()) {
        if (kernel_.link.up && !kernel_.stalled) return {Received::Kind::kFrame, *frame, 0};
      }
    }
    if (kernel_.inbox.empty()) return {};
    const Received next = kernel_.inbox.front();
    kernel_.inbox.pop_front();
    return next;
  }

  CanLink link() override { return kernel_.link; }

  std::optional<CanLink> nextChange() override {
    if (kernel_.changes.empty()) return std::nullopt;
    const CanLink next = kernel_.changes.front();
    kernel_.changes.pop_front();
    return next;
  }

  bool startCycle() override {
    if (!kernel_.helper_missing.empty()) return tell_missing_ = true, false;
    ++kernel_.cycles;
    steps_ = kernel_.helper_steps;
    running_ = true;
    return true;
  }

  LinkCycle cycle() override {
    if (std::exchange(tell_missing_, false)) return {LinkCycle::Stage::kFailed, kernel_.helper_missing};
    if (!running_) return {};
    if (steps_-- > 0) return {LinkCycle::Stage::kRunning, ""};
    running_ = false;
    if (!kernel_.helper_fails.empty()) return {LinkCycle::Stage::kFailed, kernel_.helper_fails};
    kernel_.down();
    kernel_.up();
    if (kernel_.silent_cycle) kernel_.inbox.clear(), kernel_.changes.clear();
    return {LinkCycle::Stage::kDone, ""};
  }

  int descriptor() const override { return -1; }

 private:
  FakeKernel& kernel_;
  bool tell_missing_ = false;
  bool running_ = false;
  int steps_ = 0;
};

}  // namespace tunnel_pilot::can
