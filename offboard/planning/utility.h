#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vantage {

/// A candidate view with what was found of it.
struct ScoredView {
  std::int64_t view_id = 0;
  double gain = 0;     ///< G_v
  double cost = 0;     ///< C_v, m
  double utility = 0;  ///< U_v
};

/// When a run has gained enough: what no view may reach any more. The share does not depend on the object's size.
struct GainLimit {
  double gain = 0;   ///< g_thresh of Eq. 13; 0: never
  double share = 0;  ///< of what the best view promised at the run's first choice, 0 to 1; 0: never
};

/// Says when a run has gained enough. Asked once before each choice.
class GainStop {
 public:
  explicit GainStop(const GainLimit& limit) : limit_(limit) {}

  /// Why it has: no view gains as much as the limit, or its share of the first largest gain. Nothing while one does,
  /// and for no views. The first call's views are the reference.
  std::optional<std::string> reached(std::span<const ScoredView> views);

 private:
  GainLimit limit_;
  std::optional<double> first_;  // largest gain of the first call
};

/// Eq. 11: U_v = G_v / sum G - C_v / sum C. A zero sum makes its term 0.
void compute_utilities(std::vector<ScoredView>* views);

/// Eq. 12: index of the view with the largest utility; ties go to the lower cost, then to the lower view id. Nothing
/// for no views.
std::optional<std::size_t> next_best_view(const std::vector<ScoredView>& views);

}  // namespace vantage
