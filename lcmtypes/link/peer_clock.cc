#include "lcmtypes/link/peer_clock.h"

#include <algorithm>
#include <cstdlib>

namespace vantage {
namespace {

/// Beyond their uncertainties two exchanges may differ by this much before one of the clocks must have been set.
constexpr std::int64_t kClockWasSet_us = 5'000;

}  // namespace

void PeerClock::add(std::int64_t sent, std::int64_t heard, std::int64_t answered, std::int64_t back) {
  const std::int64_t round_trip = (back - sent) - (answered - heard);
  if (round_trip < 0 || answered < heard || back < sent) return;
  const ClockOffset latest{((heard - sent) + (answered - back)) / 2, round_trip / 2};
  if (const std::optional<ClockOffset> known = offset();
      known &&
      std::abs(known->offset_us - latest.offset_us) > known->uncertainty_us + latest.uncertainty_us + kClockWasSet_us) {
    count_ = 0;
  }
  kept_[count_++ % kKept] = latest;
}

std::optional<ClockOffset> PeerClock::offset() const {
  if (count_ == 0) return std::nullopt;
  return *std::min_element(
      kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(std::min(count_, kKept)),
      [](const ClockOffset& a, const ClockOffset& b) { return a.uncertainty_us < b.uncertainty_us; });
}

}  // namespace vantage
