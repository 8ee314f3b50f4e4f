#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/can/can_bus.h"
#include "lcmtypes/link/clock.h"

namespace vantage::can {

/// A bus inside one process, in one thread, on a clock that only moves when somebody on the bus waits.
///
/// Who waits on one of its buses lets time pass tick by tick; at every tick the listeners (simulated drives) take what
/// came in and answer. Same calls, same frames, to the bit.
class MemoryCanNetwork {
 public:
  explicit MemoryCanNetwork(ManualClock& clock, std::chrono::nanoseconds tick = std::chrono::milliseconds(1));
  ~MemoryCanNetwork();

  /// One more node. The network must outlive it.
  std::unique_ptr<CanBus> attach(const std::string& name);
  /// Called after every step of time.
  void on_tick(std::function<void()> listener) { listeners_.push_back(std::move(listener)); }
  void advance_to(std::chrono::nanoseconds time);

  /// To every node, as if the controller had sent it: error frames.
  void inject(const CanFrame& frame);
  /// While down, nothing is sent and nothing arrives.
  void set_down(bool down) { down_ = down; }
  /// Frames a node's transmit queue takes per tick before `send` gives kQueueFull. 0: none.
  void set_transmit_queue(std::size_t frames) { transmit_queue_ = frames; }
  /// Sees every frame that was sent.
  void set_witness(std::function<void(const CanFrame&)> witness) { witness_ = std::move(witness); }
  /// Times that a node asked for a restart.
  int restarts_asked() const { return restarts_asked_; }

 private:
  class Node;
  void tick(std::chrono::nanoseconds step);

  ManualClock& clock_;
  std::chrono::nanoseconds tick_;
  std::vector<Node*> nodes_;
  std::vector<std::function<void()>> listeners_;
  std::function<void(const CanFrame&)> witness_;
  std::size_t transmit_queue_ = 1000;
  bool down_ = false;
  int restarts_asked_ = 0;
};

}  // namespace vantage::can
