#pragma once

#include <array>
#include <map>
#include <vector>

#include "offboard/experiment/method_run.h"
#include "offboard/gain/view_gain.h"

namespace vantage {

/// One object with one seed, on which weights of `combined` are tried many times.
///
/// Other weights often choose the same views for a while: gains after a sequence of views are kept, all formulations
/// at once, and no map is built again to find them. For one thread at a time.
class TuningScene {
 public:
  /// \pre views.prepare() was true. `views` and `truth` must outlive it. `options.views`: of a run, at least 2.
  TuningScene(const SceneViews& views, const SceneTruth& truth, const ExperimentOptions& options);

  /// Places in views.candidates(), in the order in which run_method's `combined` visits them with these weights.
  std::vector<std::size_t> visit(const CombinedWeights& weights);

  /// Mean coverage over views 2 to 12 of that run. A point counts as covered when one of the views covers it by itself.
  double area(const CombinedWeights& weights);

  /// Mean gain of the open views after the first one, by formulation.
  std::array<double, kFormulations> first_gains();
  /// Of what the first view shows.
  ShapeDescriptor descriptor() const;

 private:
  using Sequence = std::vector<std::size_t>;
  struct GrowingMap;

  /// By open candidate in order of places. Integrates into `map` what it lacks of `visited`, when the gains are new.
  const std::vector<ViewGain>& gains_after(const Sequence& visited, GrowingMap* map);

  const SceneViews& views_;
  const SceneTruth& truth_;
  ExperimentOptions options_;
  std::map<Sequence, std::vector<ViewGain>> gains_;
};

}  // namespace vantage
