#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace vantage {

/// How far the peer's clock is ahead of ours.
struct ClockOffset {
  std::int64_t offset_us = 0;       ///< peer's utime minus ours
  std::int64_t uncertainty_us = 0;  ///< half the round trip of the best exchange
};

/// Measures the offset between two clocks by messages that go both ways, as NTP does (RFC 5905, section 8): of the
/// latest exchanges the one with the shortest round trip counts.
class PeerClock {
 public:
  /// One exchange: `sent` by us, `heard` and `answered` by the peer's clock, `back` by ours; all us since 1970. An
  /// exchange of negative duration is passed over; one that contradicts the kept ones (a clock was set) discards them.
  void add(std::int64_t sent, std::int64_t heard, std::int64_t answered, std::int64_t back);

  /// Nothing before the first exchange.
  std::optional<ClockOffset> offset() const;

 private:
  static constexpr std::size_t kKept = 16;  // four seconds of heartbeats

  std::array<ClockOffset, kKept> kept_{};
  std::size_t count_ = 0;
};

}  // namespace vantage
