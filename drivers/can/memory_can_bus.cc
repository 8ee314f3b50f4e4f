#include "drivers/can/memory_can_bus.h"

#include <algorithm>
#include <array>
#include <bitset>

namespace vantage::can {
namespace {

constexpr std::size_t kReceiveQueue = 512;  // frames, as SocketCAN's default buffer holds about
constexpr std::size_t kIdentifiers = 0x800;

}  // namespace

class MemoryCanNetwork::Node final : public CanBus {
 public:
  Node(MemoryCanNetwork& network, std::string name) : network_(network), name_(std::move(name)) { accepted_.set(); }
  ~Node() override { std::erase(network_.nodes_, this); }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  SendResult send(const CanFrame& frame) override {
    if (network_.down_ || sent_this_tick_ >= network_.transmit_queue_) {
      ++counters_.refused_sends;
      return network_.down_ ? SendResult::kDown : SendResult::kQueueFull;
    }
    ++sent_this_tick_;
    ++counters_.sent;
    CanFrame stamped = frame;
    stamped.time = network_.clock_.monotonic();
    if (network_.witness_) network_.witness_(stamped);
    for (Node* node : network_.nodes_) {
      if (node != this) node->deliver(stamped);
    }
    return SendResult::kSent;
  }

  ReceiveResult receive(CanFrame* frame) override {
    if (count_ == 0) return network_.down_ ? ReceiveResult::kDown : ReceiveResult::kNothing;
    *frame = queue_[first_];
    first_ = (first_ + 1) % kReceiveQueue;
    --count_;
    ++counters_.received;
    return ReceiveResult::kFrame;
  }

  bool wait_until(std::chrono::nanoseconds deadline) override {
    while (count_ == 0 && network_.clock_.monotonic() < deadline) {
      network_.tick(std::min(network_.tick_, deadline - network_.clock_.monotonic()));
    }
    return count_ != 0;
  }

  void sleep_until(std::chrono::nanoseconds deadline) override { network_.advance_to(deadline); }

  void accept_only(std::span<const std::uint32_t> ids) override {
    accepted_.reset();
    for (const std::uint32_t id : ids) accepted_.set(id % kIdentifiers);
  }

  bool restart(std::string*) override {
    ++network_.restarts_asked_;
    return true;
  }

  const BusCounters& counters() const override { return counters_; }
  std::string name() const override { return name_; }

  void deliver(const CanFrame& frame) {
    if (!frame.error && (frame.id >= kIdentifiers || !accepted_.test(frame.id))) return;
    if (count_ == kReceiveQueue) {
      ++counters_.overflowed;
      return;
    }
    queue_[(first_ + count_) % kReceiveQueue] = frame;
    ++count_;
  }
  void tick_passed() { sent_this_tick_ = 0; }

 private:
  MemoryCanNetwork& network_;
  std::string name_;
  std::array<CanFrame, kReceiveQueue> queue_;
  std::size_t first_ = 0, count_ = 0;
  std::size_t sent_this_tick_ = 0;
  std::bitset<kIdentifiers> accepted_;
  BusCounters counters_;
};

MemoryCanNetwork::MemoryCanNetwork(ManualClock& clock, std::chrono::nanoseconds tick) : clock_(clock), tick_(tick) {}

MemoryCanNetwork::~MemoryCanNetwork() = default;

std::unique_ptr<CanBus> MemoryCanNetwork::attach(const std::string& name) {
  auto node = std::make_unique<Node>(*this, name);
  nodes_.push_back(node.get());
  return node;
}

void MemoryCanNetwork::tick(std::chrono::nanoseconds step) {
  clock_.advance(step);
  for (Node* node : nodes_) node->tick_passed();
  for (const auto& listener : listeners_) listener();
}

void MemoryCanNetwork::advance_to(std::chrono::nanoseconds time) {
  while (clock_.monotonic() < time) tick(std::min(tick_, time - clock_.monotonic()));
}

void MemoryCanNetwork::inject(const CanFrame& frame) {
  CanFrame stamped = frame;
  stamped.time = clock_.monotonic();
  for (Node* node : nodes_) node->deliver(stamped);
}

}  // namespace vantage::can
