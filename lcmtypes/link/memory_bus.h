#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>

#include "lcmtypes/link/message_bus.h"

namespace vantage {

/// A bus within one process: messages arrive in the order in which they were published, none is lost unless a test
/// asks for it. Replays and tests run on it.
class MemoryBus final : public MessageBus {
 public:
  /// Decides the fate of a message: how many copies of it arrive (0: lost).
  using Fate = std::function<int(std::string_view channel)>;

  void publish(std::string_view channel, std::span<const std::uint8_t> bytes) override;
  void subscribe(std::string_view channel, Handler handler) override;
  bool handle(std::chrono::milliseconds timeout) override;
  void set_fate(Fate fate);

 private:
  struct Letter {
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };

  std::mutex mutex_;  // guards queue_ and fate_
  std::condition_variable arrived_;
  std::deque<Letter> queue_;
  Fate fate_;
  std::multimap<std::string, Handler, std::less<>> handlers_;  // only the thread that calls handle
};

}  // namespace vantage
