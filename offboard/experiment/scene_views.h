#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include <vantage/depth_map_t.hpp>

#include "lcmtypes/link/depth_map.h"
#include "offboard/experiment/experiment_object.h"
#include "offboard/planning/view_space.h"

namespace vantage {

/// The depth maps that the stereo pair measures of one object from every candidate view, with one seed.
///
/// Each view is rendered and matched once: `prepare` makes all that are missing, at `folder` when it is given, where
/// they outlast the program. A depth map always comes out of its packed form (depth_codec.h), so that nothing depends
/// on whether it was just made, and what is decided by is what a network would have delivered.
///
/// The seed is that of texture, noise and truth. Same object, views and seed, same depth maps to the bit.
class SceneViews {
 public:
  /// `object` must outlive it. `folder`: of packed depth maps, made when missing; empty: kept in memory alone.
  SceneViews(const ExperimentObject& object, std::vector<CandidateView> candidates, std::uint64_t seed,
             std::filesystem::path folder);

  /// Makes every depth map that is not there. `made` is told, by one thread at a time, how many of the missing ones are
  /// done. False when `stop` was set before the end. \throws InputError when a file can't be written.
  bool prepare(int threads, const std::atomic<bool>& stop, const std::function<void(int done, int missing)>& made);

  /// Views that have no file in the folder.
  std::size_t files_missing() const;

  const std::vector<CandidateView>& candidates() const { return candidates_; }
  /// Depth map of the candidate at a place in candidates(). For any number of threads. \pre prepare() was true
  DepthMap depth_map(std::size_t candidate) const;

  std::uint64_t seed() const { return seed_; }
  const ExperimentObject& object() const { return object_; }

 private:
  std::filesystem::path file_of(std::size_t candidate) const;
  bool load(std::size_t candidate);

  const ExperimentObject& object_;
  std::vector<CandidateView> candidates_;
  std::uint64_t seed_;
  std::filesystem::path folder_;
  std::vector<depth_map_t> packed_;  // by candidate; an empty one is not there yet
};

}  // namespace vantage
