#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "offboard/lookahead/set_cover.h"

namespace vantage {

struct ViewTourOptions {
  std::size_t length = 5;                                       ///< views, at least 1
  std::size_t kept = 24;                                        ///< tours of each length from two views on, at least 1
  double discount = 0.8;                                        ///< of a view's worth for each view before it
  double way_weight_per_m = 0.02;                               ///< worth of the reference gain, for each metre of way
  double most_way_m = std::numeric_limits<double>::infinity();  ///< of the whole tour
};

/// The views of the best tour, in its order: that with the largest  sum over i of discount^i (gain_i / reference -
/// way_weight_per_m * length_i),  gain_i what the i-th view adds to those before it, length_i (m) the way to it.
/// `from`, `positions`: world, m, the latter by view of `cover`. As many views as `options` says, or there are, or lie
/// on so much way; ties go to the tour that comes first by view. Views taken of `cover` are forgotten. \pre a view lies
/// within most_way_m, and reference > 0
///
/// A beam search: every first view, every second one, and from then on the best tours are made longer. It is lazy as
/// Minoux's greedy (1978) is: a gain is computed again only where its old value, which bounds it, would bring the tour
/// among those that are kept. (The best order of the greedy set misses what matters most: three views a third of the
/// way round measure more than one from the opposite side and then two from between.)
std::vector<std::size_t> best_tour(const Eigen::Vector3d& from, std::span<const Eigen::Vector3d> positions,
                                   double reference, const ViewTourOptions& options, SetCover* cover);

}  // namespace vantage
