#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "offboard/experiment/experiment_object.h"
#include "offboard/experiment/weight_search.h"
#include "offboard/planning/learned_weights.h"

namespace vantage {

struct TuneOptions {
  int seeds = 2;                ///< first views, textures and noises of each object, from 1
  WeightSearchOptions search;   ///< on the whole set, and again on each object
  ExperimentOptions run;        ///< how weights are tried
  std::filesystem::path cache;  ///< of packed depth maps; empty: in memory alone
};

/// Learns weights of `combined` on objects: one set for all of them, from the paper's weights on; then from there one
/// for each. The start (the paper's weights, those without a share raised to the search's least) is among what is
/// tried: what comes out is never worse on what it was learned on. Every value goes to the file `log` at once, and is
/// taken from there if it was paid for before. Nothing when `stop` was set before the end. \throws InputError for a log
/// of other settings.
std::optional<LearnedWeights> tune_weights(const std::vector<ExperimentObject>& objects, const TuneOptions& options,
                                           const std::filesystem::path& log, const std::atomic<bool>& stop,
                                           std::ostream& terminal);

/// What weights are learned with, a line each: head of the log, comment of the file.
std::string describe(const std::vector<ExperimentObject>& objects, const TuneOptions& options);

}  // namespace vantage
