#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "offboard/experiment/evaluation_log.h"
#include "offboard/experiment/tuning_scene.h"

namespace vantage {

/// The search's coordinates of weights: log10 of each formulation's share, its weight times its mean gain after the
/// first view, over the largest share. Formulations of any magnitude begin alike, and none becomes negative.
class WeightCoordinates {
 public:
  static constexpr double kLeast = -3;

  /// Formulations that gain nothing after the first view of any scene take no part.
  explicit WeightCoordinates(const std::vector<TuningScene*>& scenes);

  /// Coordinates below kLeast are taken for it. \pre one for each formulation that takes part
  CombinedWeights weights_of(const Eigen::VectorXd& x) const;
  Eigen::VectorXd of_weights(const CombinedWeights& weights) const;

 private:
  std::vector<Formulation> formulations_;
  std::vector<double> mean_gain_;
};

/// What a search has found.
struct FoundWeights {
  Eigen::VectorXd x;  ///< the best of all that were tried, the start among them
  double value = 0;   ///< its mean area on the scenes
  double value_of_start = 0;
};

struct WeightSearchOptions {
  int evaluations = 120;  ///< at most
  std::uint64_t seed = 1;
  int threads = 1;  ///< does not change the result
};

/// Looks by CMA-ES (cma_es.h) for weights with the largest mean TuningScene::area on scenes.
///
/// Values go to `log` under `name` as they come; those that it holds are not paid for again, so that a search that was
/// interrupted ends as if it had not been. `tell` hears of each value that was paid for, with the best so far.
/// Nothing when `stop` was set before the end.
std::optional<FoundWeights> search_weights(const std::string& name, const std::vector<TuningScene*>& scenes,
                                           const WeightCoordinates& coordinates, const Eigen::VectorXd& start,
                                           const WeightSearchOptions& options, EvaluationLog* log,
                                           const std::atomic<bool>& stop,
                                           const std::function<void(const FoundWeights&)>& tell);

}  // namespace vantage
