#include "drivers/camera/capture_clock.h"

#include <algorithm>
#include <cstdio>

namespace vantage {

using std::chrono::nanoseconds;

std::optional<nanoseconds> CaptureClock::capture_time(nanoseconds stamp, nanoseconds now) {
  const nanoseconds age = now - stamp;
  if (verdict_ == Verdict::kLearning) {
    ages_.push_back(age);
    if (ages_.size() == kLearnt) judge();
    if (verdict_ == Verdict::kLearning) return {};
  }
  if (verdict_ == Verdict::kRefused) return {};
  const nanoseconds time = stamp + offset_;
  // A consumer that takes its time finds old frames; only the future is impossible.
  if (time > now + (verdict_ == Verdict::kCorrected ? period_ : nanoseconds(0))) return {};
  return std::min(time, now);
}

void CaptureClock::judge() {
  const auto [least, most] = std::minmax_element(ages_.begin(), ages_.end());
  // The youngest frames count: others may have waited in the queue.
  if (*least >= nanoseconds(0) && *least < 2 * period_) {
    verdict_ = Verdict::kGood;
  } else if (*most - *least <= period_) {
    // A frame is on the average about half a period old when it comes.
    verdict_ = Verdict::kCorrected;
    offset_ = *least - period_ / 2;
  } else {
    verdict_ = Verdict::kRefused;
  }
}

std::string CaptureClock::text() const {
  char text[160];
  const double seconds = std::chrono::duration<double>(offset_).count();
  switch (verdict_) {
    case Verdict::kLearning:
      return "time stamps not judged yet";
    case Verdict::kGood:
      return "time stamps are of the monotonic clock";
    case Verdict::kCorrected:
      std::snprintf(text, sizeof text, "the driver's clock is %.3f s %s; corrected, to half a frame",
                    seconds < 0 ? -seconds : seconds, seconds < 0 ? "ahead" : "behind");
      return text;
    case Verdict::kRefused:
      return "the driver's time stamps follow no steady clock; its frames are refused";
  }
  return "";
}

}  // namespace vantage
