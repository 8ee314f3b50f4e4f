#include "offboard/planning/utility.h"

#include <algorithm>
#include <tuple>

#include <fmt/format.h>

namespace vantage {

std::optional<std::string> GainStop::reached(std::span<const ScoredView> views) {
  if (views.empty()) return std::nullopt;
  const auto less = [](const ScoredView& a, const ScoredView& b) { return a.gain < b.gain; };
  const double most = std::max_element(views.begin(), views.end(), less)->gain;
  if (!first_) first_ = most;
  if (most < limit_.gain) return fmt::format("no view gains {} any more", limit_.gain);
  if (most < limit_.share * *first_) {
    return fmt::format("no view gains {:.3g} any more, {} of what the best did at first", limit_.share * *first_,
                       limit_.share);
  }
  return std::nullopt;
}

void compute_utilities(std::vector<ScoredView>* views) {
  double gains = 0, costs = 0;
  for (const ScoredView& view : *views) {
    gains += view.gain;
    costs += view.cost;
  }
  for (ScoredView& view : *views) {
    view.utility = (gains == 0 ? 0 : view.gain / gains) - (costs == 0 ? 0 : view.cost / costs);
  }
}

std::optional<std::size_t> next_best_view(const std::vector<ScoredView>& views) {
  if (views.empty()) return std::nullopt;
  const auto best = std::min_element(views.begin(), views.end(), [](const ScoredView& a, const ScoredView& b) {
    return std::make_tuple(-a.utility, a.cost, a.view_id) < std::make_tuple(-b.utility, b.cost, b.view_id);
  });
  return static_cast<std::size_t>(best - views.begin());
}

}  // namespace vantage
