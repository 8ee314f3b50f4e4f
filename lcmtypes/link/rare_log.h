#pragma once

#include <chrono>
#include <cstdint>

#include "lcmtypes/link/clock.h"

namespace vantage {

/// Keeps a log readable when somebody provokes the same line a thousand times a second.
class RareLog {
 public:
  explicit RareLog(const Clock& clock) : clock_(clock) {}

  /// True at most once a second: then the line is to be written. Else it is counted.
  bool due() {
    const std::chrono::nanoseconds now = clock_.monotonic();
    if (written_ && now - last_ < std::chrono::seconds(1)) {
      ++held_back_;
      return false;
    }
    written_ = true;
    last_ = now;
    held_back_told_ = held_back_;
    held_back_ = 0;
    return true;
  }

  /// Lines held back between the last two that were due.
  std::uint64_t held_back() const { return held_back_told_; }

 private:
  const Clock& clock_;
  bool written_ = false;
  std::chrono::nanoseconds last_{0};
  std::uint64_t held_back_ = 0, held_back_told_ = 0;
};

}  // namespace vantage
