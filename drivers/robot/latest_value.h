#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace vantage {

/// The latest value that one thread hands to another, without locks: neither ever waits for the other, and the reader
/// sees whole values only (three slots, one of them in transit).
template <typename T>
class LatestValue {
 public:
  /// By the writing thread alone.
  void write(const T& value) {
    slots_[back_] = value;
    back_ = middle_.exchange(static_cast<std::uint8_t>(back_ | kNew), std::memory_order_acq_rel) & kSlot;
  }

  /// By the reading thread alone. True when the value is newer than at the last call; otherwise it is the same one.
  bool read(T* value) {
    const bool fresh = (middle_.load(std::memory_order_acquire) & kNew) != 0;
    if (fresh) front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kSlot;
    *value = slots_[front_];
    return fresh;
  }

 private:
  static constexpr std::uint8_t kSlot = 3, kNew = 4;
  std::array<T, 3> slots_{};
  std::atomic<std::uint8_t> middle_{1};
  std::uint8_t back_ = 0;   // the writer's
  std::uint8_t front_ = 2;  // the reader's
};

}  // namespace vantage
