#include "lcmtypes/link/memory_bus.h"

#include <utility>

namespace vantage {

void MemoryBus::publish(std::string_view channel, std::span<const std::uint8_t> bytes) {
  {
    const std::lock_guard lock(mutex_);
    const int copies = fate_ ? fate_(channel) : 1;
    for (int i = 0; i < copies; ++i) queue_.push_back({std::string(channel), {bytes.begin(), bytes.end()}});
  }
  arrived_.notify_one();
}

void MemoryBus::subscribe(std::string_view channel, Handler handler) {
  handlers_.emplace(std::string(channel), std::move(handler));
}

void MemoryBus::set_fate(Fate fate) {
  const std::lock_guard lock(mutex_);
  fate_ = std::move(fate);
}

bool MemoryBus::handle(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  if (!arrived_.wait_for(lock, timeout, [this] { return !queue_.empty(); })) return false;
  const Letter letter = std::move(queue_.front());
  queue_.pop_front();
  lock.unlock();
  const auto [first, last] = handlers_.equal_range(letter.channel);
  for (auto handler = first; handler != last; ++handler) handler->second(letter.bytes);
  return true;
}

}  // namespace vantage
