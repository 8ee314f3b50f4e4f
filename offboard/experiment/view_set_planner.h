#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "offboard/experiment/expected_view.h"
#include "offboard/experiment/view_chooser.h"
#include "offboard/experiment/view_tour.h"

namespace vantage {

struct ViewSetOptions {
  ViewTourOptions tour;
  ExpectedViewOptions expected;
};

/// Looks further than one view: plans the next views as a set with a tour through it, goes to the tour's first view,
/// and plans again with what was seen there. What is there to be seen, SurfaceNetwork expects; what views would see of
/// it, ExpectedViews; what they see together, SetCover.
///
/// Its tour is best_tour's (view_tour.h), with the geometric mean of the largest gain of a view now and at the run's
/// first choice as reference: at the end, when little is to be gained, it goes less far for the same share of it. It
/// tells ExpectedViews which views it took, and what they should have measured: that decides which way hidden surface
/// faces, and what is missed again. Deterministic. For one run.
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
