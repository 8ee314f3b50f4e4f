#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace vantage {

/// A candidate view with what was found of it.
struct ScoredView {
  std::int64_t view_id = 0;
  double gain = 0;     ///< G_v
  double cost = 0;     ///< C_v, m
  double utility = 0;  ///< U_v
};

/// Eq. 13: no view gains `threshold`; false for no views.
bool none_gains(std::span<const ScoredView> views, double threshold);

/// Eq. 11: U_v = G_v / sum G - C_v / sum C. A zero sum makes its term 0.
void compute_utilities(std::vector<ScoredView>* views);

/// Eq. 12: index of the view with the largest utility; ties go to the lower cost, then to the lower view id. Nothing
/// for no views.
std::optional<std::size_t> next_best_view(const std::vector<ScoredView>& views);

}  // namespace vantage
