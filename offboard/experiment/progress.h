#pragma once

#include <string>

#include "lcmtypes/link/clock.h"

namespace vantage {

/// How long an experiment will still take, from how long its views and its runs took so far.
///
/// Views and runs come in turns and take very different times, and views that are in the cache take none. So the time
/// that passed before each is counted to its kind, and what is left of a kind goes on at that kind's own pace. A kind
/// of which none is done yet is judged by the other, a run as kRunPerView views.
class Progress {
 public:
  static constexpr double kRunPerView = 5;

  /// Time begins to count now. `views`: those to render, without what the cache holds.
  Progress(const Clock& clock, int views, int runs);

  void view_made() { count(&views_); }
  void run_made() { count(&runs_); }

  double left_s() const;
  /// "1:05 left".
  std::string text() const;

 private:
  struct Kind {
    int left, done = 0;
    double seconds = 0;  // that the done ones took
  };
  void count(Kind* kind);

  const Clock& clock_;
  std::chrono::nanoseconds last_;
  Kind views_, runs_;
};

}  // namespace vantage
