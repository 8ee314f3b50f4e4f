#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "offboard/planning/learned_weights.h"
#include "offboard/planning/view_chooser.h"

namespace vantage {

/// For each candidate (by place, ids as in the scene) which points of the true surface its depth map covers by itself:
/// bits, 64 a word.
struct TrueCoverage {
  std::vector<std::int64_t> view_ids;
  std::vector<std::vector<std::uint64_t>> covered;  ///< by candidate
};

/// The eight formulations of the paper by their names (formulation.h), then `random`, `sequential` (by id, round after
/// round from the first view), `oracle` (the view that covers most of the true surface not yet covered: the upper bound
/// for choosing one step ahead, without regard to movement), `view_set` (view_set_planner.h), `view_set_known` (the
/// same, which ends when the object is known), and `combined` with learned weights: `combined_learned` (those of the
/// whole training set), `combined_nearest` (those of the training object nearest to what the first view shows).
const std::vector<std::string>& method_names();

/// True for the paper's eight.
bool is_paper_method(std::string_view method);

/// True for the methods that need ChooserOptions::learned.
bool needs_learned_weights(std::string_view method);

/// Methods of a list; `all` stands for all (those that need learned weights only with `learned`), `paper` for the
/// paper's eight. In method_names()' order, each once. \throws InputError for an unknown name, with the names there
/// are, for one that needs learned weights without `learned`, and for an empty list.
std::vector<std::string> parse_methods(const std::vector<std::string>& names, bool learned = false);

/// What methods choose with.
struct ChooserOptions {
  double cost_weight = 1;                         ///< UtilityChooser's
  int ray_columns = 80, ray_rows = 60;            ///< of gains; these rank views as every pixel would. Not for view_set
  std::shared_ptr<const LearnedWeights> learned;  ///< for combined_learned and combined_nearest
  double known_share = 0.008;                     ///< view_set_known's; docs/view_set.md says what others bring
};

/// g_thresh of Eq. 13: a method's run ends when no view gains as much. 0: it never does.
double known_share_of(std::string_view method, const ChooserOptions& options);

/// \pre a name of method_names(). `truth` must outlive the chooser; it is read by the oracle alone.
std::unique_ptr<ViewChooser> make_chooser(const std::string& method, std::uint64_t seed, const TrueCoverage& truth,
                                          const ChooserOptions& options = {});

/// The first view of a run: 0 for seed 1, else picked by the seed. \pre views > 0
std::int64_t first_view_of_seed(std::uint64_t seed, std::size_t views);

}  // namespace vantage
