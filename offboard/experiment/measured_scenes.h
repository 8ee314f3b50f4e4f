#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <vector>

#include "offboard/experiment/method_run.h"

namespace vantage {

struct MeasuredScenesOptions {
  int seeds = 1;  ///< of each object, from 1
  int threads = 1;
  ExperimentOptions run;
  std::vector<CandidateView> candidates;  ///< empty: the paper's
  std::filesystem::path cache;            ///< of packed depth maps; empty: in memory alone
};

/// Objects one after another, with every seed: what every candidate measures, and the truth. False when `stop` was set
/// before the end. \throws InputError when a depth map can't be written.
bool for_each_measured_scene(const std::vector<ExperimentObject>& objects, const MeasuredScenesOptions& options,
                             const std::atomic<bool>& stop,
                             const std::function<void(const SceneViews& scene, const SceneTruth& truth)>& use);

}  // namespace vantage
