#include "offboard/experiment/progress.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <fmt/format.h>

namespace vantage {

Progress::Progress(const Clock& clock, int views, int runs)
    : clock_(clock), last_(clock.monotonic()), views_{views}, runs_{runs} {}

void Progress::count(Kind* kind) {
  const std::chrono::nanoseconds now = clock_.monotonic();
  kind->seconds += std::chrono::duration<double>(now - std::exchange(last_, now)).count();
  ++kind->done;
  kind->left = std::max(0, kind->left - 1);
}

double Progress::left_s() const {
  if (views_.done == 0 && runs_.done == 0) return 0;
  double view_s = views_.done == 0 ? 0 : views_.seconds / views_.done;
  double run_s = runs_.done == 0 ? kRunPerView * view_s : runs_.seconds / runs_.done;
  if (views_.done == 0) view_s = run_s / kRunPerView;
  return views_.left * view_s + runs_.left * run_s;
}

std::string Progress::text() const {
  const auto whole = static_cast<std::int64_t>(left_s() + 0.5);
  return fmt::format("{}:{:02} left", whole / 60, whole % 60);
}

}  // namespace vantage
