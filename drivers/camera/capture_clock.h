#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace vantage {

/// Judges the time stamps of a camera's driver, and mends them where they are of another clock.
///
/// A stamp is good when the frame is between nothing and two frame periods old on arrival. Some drivers stamp with
/// another clock: then the first frames tell its offset, when it is steady to within a period, and it is taken off from
/// there on; otherwise no stamp is to be trusted, and none passes.
class CaptureClock {
 public:
  enum class Verdict {
    kLearning,  ///< the first frames: not judged yet
    kGood,
    kCorrected,  ///< `offset` is taken off every stamp
    kRefused     ///< the stamps follow no clock that can be corrected
  };

  explicit CaptureClock(std::chrono::nanoseconds period) : period_(period) {}

  /// The capture time on this computer's clock of a frame that came at `now`; nothing while learning, once refused, or
  /// for a single frame whose stamp makes no sense.
  std::optional<std::chrono::nanoseconds> capture_time(std::chrono::nanoseconds stamp, std::chrono::nanoseconds now);

  Verdict verdict() const { return verdict_; }
  /// What the driver's clock is behind this one's (negative: ahead), besides the frames' own age.
  std::chrono::nanoseconds offset() const { return offset_; }
  /// In words: "the driver's clock is 29.000 s behind; corrected".
  std::string text() const;

 private:
  static constexpr std::size_t kLearnt = 5;  // frames that are looked at first
  void judge();

  std::chrono::nanoseconds period_;
  Verdict verdict_ = Verdict::kLearning;
  std::chrono::nanoseconds offset_{0};
  std::vector<std::chrono::nanoseconds> ages_;
};

}  // namespace vantage
