#include "drivers/robot/cycle_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace vantage {

using std::chrono::nanoseconds;

void CycleStatistics::add(nanoseconds lateness) {
  const nanoseconds late = std::max(lateness, nanoseconds(0));
  const double ratio = static_cast<double>(late.count()) / kFirst;
  const double bucket = ratio <= 1 ? 0 : std::ceil(std::log(ratio) / std::log(kRatio));
  ++counts_[std::min(static_cast<std::size_t>(bucket), kBuckets - 1)];
  ++cycles_;
  sum_ += late;
  worst_ = std::max(worst_, late);
}

nanoseconds CycleStatistics::mean() const {
  return cycles_ == 0 ? nanoseconds(0) : sum_ / static_cast<std::int64_t>(cycles_);
}

nanoseconds CycleStatistics::quantile(double part) const {
  const double wanted = part * static_cast<double>(cycles_);
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    seen += counts_[i];
    if (static_cast<double>(seen) < wanted) continue;
    const double upper = kFirst * std::pow(kRatio, static_cast<double>(i));
    return std::min(nanoseconds(static_cast<std::int64_t>(upper)), worst_);
  }
  return worst_;
}

std::string to_text(const CycleStatistics& statistics) {
  const auto us = [](nanoseconds time) { return static_cast<double>(time.count()) / 1e3; };
  char text[200];
  std::snprintf(
      text, sizeof text, "%llu cycles, %llu missed; late by %.0f us on the mean, %.0f us in 99 %%, %.0f us at worst",
      static_cast<unsigned long long>(statistics.cycles()), static_cast<unsigned long long>(statistics.missed()),
      us(statistics.mean()), us(statistics.quantile(0.99)), us(statistics.worst()));
  return text;
}

}  // namespace vantage
