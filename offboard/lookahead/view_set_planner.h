#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "offboard/lookahead/expected_view.h"
#include "offboard/lookahead/view_tour.h"
#include "offboard/planning/view_chooser.h"

namespace vantage {

/// Ways count in mean distances of the first choice's views to what they face: the same price at any scale.
struct ViewSetOptions {
  ViewTourOptions tour;  ///< its way_weight_per_m and most_way_m are the planner's
  ExpectedViewOptions expected;
  double first_share = 0.6;   ///< of the reference, 0 to 1: first^first_share present^(1 - first_share)
  double way_weight = 0.013;  ///< worth of the reference gain, for each distance of way
  double dear_after = 5.3;    ///< distances, over 0: when the run has made more, its way over this, squared, times that
};

/// Looks further than one view: plans the next views as a set with a tour through it, goes to the tour's first view,
/// and plans again with what was seen there. What is there to be seen, SurfaceNetwork expects; what views would see of
/// it, ExpectedViews; what they see together, SetCover.
///
/// Its tour is best_tour's (view_tour.h), with a weighted geometric mean of the largest gain of a view at the run's
/// first choice and at present as reference: at the end, when little is to be gained, it goes less far for the same
/// share of it; and metres grow dear with the way that the run has made, so that an object that goes on hiding a little
/// here and there does not make the robot wander. It tells ExpectedViews what the views that it chose should have
/// measured, where they were taken: what they missed is missed again from near there. A score's gain is what a view
/// would measure by itself, in mean voxels of surface; its utility that view's own worth. Deterministic. For one run.
class ViewSetPlanner : public ViewChooser {
 public:
  explicit ViewSetPlanner(const ViewSetOptions& options = {}) : options_(options) {}
  ChosenView choose(const Choice& choice) override;

 private:
  ViewSetOptions options_;
  std::vector<TakenView> taken_;
  std::int64_t promising_ = -1;          // id of the view chosen last,
  std::vector<ExpectedVoxel> promised_;  // and what it is expected to see
  std::optional<Eigen::Vector3d> foot_;  // on the ground, below what the views of the first choice face
  double distance_m_ = 0;                // mean, of these views to that
  double first_gain_ = 0;
};

}  // namespace vantage
