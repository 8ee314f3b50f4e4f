#pragma once

#include <chrono>
#include <cstdint>

namespace vantage {

/// Where time comes from, so that tests and replays can decide it.
class Clock {
 public:
  virtual ~Clock() = default;
  /// Never goes back. For durations and time-outs.
  virtual std::chrono::nanoseconds monotonic() const = 0;
  /// Microseconds since 1970, as LCM stamps events.
  virtual std::int64_t utime() const = 0;
};

class SystemClock final : public Clock {
 public:
  std::chrono::nanoseconds monotonic() const override { return std::chrono::steady_clock::now().time_since_epoch(); }
  std::int64_t utime() const override {
    return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
  }
};

/// Stands still until it is told to go on.
class ManualClock final : public Clock {
 public:
  std::chrono::nanoseconds monotonic() const override { return now_; }
  std::int64_t utime() const override { return std::chrono::duration_cast<std::chrono::microseconds>(now_).count(); }
  void advance(std::chrono::nanoseconds step) { now_ += step; }

 private:
  std::chrono::nanoseconds now_{0};
};

}  // namespace vantage
