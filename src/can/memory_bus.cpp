#include "tunnel_pilot/can/memory_bus.h"

#include <algorithm>
#include <utility>

namespace tunnel_pilot::can {

struct MemoryBusHub::Wire {
  std::vector<std::deque<Frame>*> queues;  // of the participants that are connected
  BusState state = BusState::kActive;
  std::size_t dropped = 0;
};

namespace {

class MemoryBus : public Bus {
 public:
  explicit MemoryBus(std::shared_ptr<MemoryBusHub::Wire> wire) : wire_(std::move(wire)) {
    wire_->queues.push_back(&queue_);
  }
  ~MemoryBus() override {
    auto& queues = wire_->queues;
    queues.erase(std::remove(queues.begin(), queues.end(), &queue_), queues.end());
  }
  MemoryBus(const MemoryBus&) = delete;
  MemoryBus& operator=(const MemoryBus&) = delete;

  bool send(const Frame& frame) override {
    if (wire_->state == BusState::kBusOff || wire_->state == BusState::kDown) return false;
    for (std::deque<Frame>* queue : wire_->queues) {
      if (queue == &queue_) continue;
      if (queue->size() < MemoryBusHub::kQueueLength) {
        queue->push_back(frame);
      } else {
        ++wire_->dropped;
      }
    }
    ++confirmed_;
    return true;
  }

  std::optional<Frame> receive() override {
    if (queue_.empty()) return std::nullopt;
    const Frame frame = queue_.front();
    queue_.pop_front();
    return frame;
  }

  std::uint64_t confirmed() const override { return confirmed_; }
  BusState state() const override { return wire_->state; }
  int descriptor() const override { return -1; }

 private:
  std::shared_ptr<MemoryBusHub::Wire> wire_;
  std::deque<Frame> queue_;
  std::uint64_t confirmed_ = 0;
};

}  // namespace

MemoryBusHub::MemoryBusHub() : wire_(std::make_shared<Wire>()) {}
MemoryBusHub::~MemoryBusHub() = default;

std::unique_ptr<Bus> MemoryBusHub::connect() { return std::make_unique<MemoryBus>(wire_); }

void MemoryBusHub::setState(BusState state) { wire_->state = state; }

std::size_t MemoryBusHub::dropped() const { return wire_->dropped; }

}  // namespace tunnel_pilot::can
