#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "offboard/experiment/expected_view.h"
#include "offboard/experiment/view_chooser.h"

namespace vantage {

/// Views as sets: which would cover most, together.
///
/// The gain of a set S is  sum over voxels x of prior(x) (1 - prod over v in S (1 - p_v(x))),  p_v(x) the probability
/// that view v sees x: what several views see counts once. Monotone and submodular, so taking the largest gain again
/// and again comes within 1 - 1/e of the best set of that size (Nemhauser, Wolsey and Fisher, 1978).
class SetCover {
 public:
  /// Both must outlive it. `views`: what each view would see; `prior`: by voxel.
  SetCover(const std::vector<std::vector<ExpectedVoxel>>& views, const std::vector<float>& prior);

  /// What the view adds to those taken.
  double gain(std::size_t view) const;
  void take(std::size_t view);
  /// Forgets the views taken.
  void clear();

  /// Up to `count` views, each the one that adds most (ties: the first), until one adds less than `least_share` of what
  /// the first did. Lazy: a gain is computed again only where its old value, which bounds it, comes first (Minoux,
  /// 1978). Takes them.
  std::vector<std::size_t> take_greedily(std::size_t count, double least_share);

 private:
  const std::vector<std::vector<ExpectedVoxel>>& views_;
  const std::vector<float>& prior_;
  std::vector<float> open_;  // by voxel: prior times the probability that no view taken sees it
  std::vector<std::size_t> taken_;
};

struct ViewSetOptions {
  std::size_t set_size = 5;       ///< views planned ahead, [1, 8]: every order of them is tried
  double least_share = 0.02;      ///< of the first view's gain: the set ends before a view that adds less
  double discount = 0.7;          ///< of a view's worth for each view before it
  double way_weight_per_m = 0.1;  ///< worth of the reference gain, for each metre of way
  double hold = 0.5;  ///< [0, 1]: the reference is the run's first largest gain to this power, times the present one's
                      ///< to the rest: 0 moves as readily for little at the end as for much at the beginning
  double least_reference = 0.5;  ///< of the run's first largest gain: for little it stays near
  ExpectedViewOptions expected;
};

/// Looks further than one view: plans the next views as a set with a tour through it, goes to the tour's first view,
/// and plans again with what was seen there. What is there to be seen, SurfaceNetwork expects; what views would see of
/// it, ExpectedViews.
///
/// Among all orders of the greedy set it takes the one with the largest  sum over i of discount^i (gain_i / reference -
/// way_weight * length_i),  gain_i what the i-th view adds to those before it, length_i the way to it: a short tour,
/// and what is worth most first. It tells ExpectedViews which views it took, and what they should have measured: that
/// decides which way hidden surface faces, and what is missed again. Deterministic; ties go to the order that comes
/// first by view id. For one run.
class ViewSetPlanner : public ViewChooser {
 public:
  explicit ViewSetPlanner(const ViewSetOptions& options = {}) : options_(options) {}
  std::size_t choose(const Choice& choice) override;

 private:
  ViewSetOptions options_;
  std::vector<TakenView> taken_;
  std::optional<Eigen::Vector3d> focus_;  // of the views, known at the first choice
  double first_gain_ = 0;
};

}  // namespace vantage
