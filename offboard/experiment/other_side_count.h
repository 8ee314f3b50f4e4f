#pragma once

#include <array>
#include <atomic>
#include <optional>
#include <ostream>
#include <vector>

#include "offboard/experiment/expected_view.h"
#include "offboard/experiment/measured_scenes.h"

namespace vantage {

using OtherSides = std::array<std::array<OtherSide, VoxelSurroundings::kHidings>, 2>;

/// What views were expected to measure without OtherSide, and what they measured, by OtherSide's bearing in bins.
class OtherSideCount {
 public:
  static constexpr int kAwayBins = 21, kAboveBins = 13;  ///< a tenth wide: from -1 and from -0.2 to 1

  void add(const Bearing& bearing, double expected, double found);
  void add(const OtherSideCount& other);

  /// The factors under which the counts are most likely, what is found being Poisson distributed (Newton's method). Of
  /// a kind of voxel of which less than `least_expected` was expected: zeros.
  OtherSides fit(double least_expected = 20) const;

 private:
  struct Bin {
    double expected = 0, found = 0;
  };
  std::array<Bin, std::size_t{2} * VoxelSurroundings::kHidings * kAwayBins * kAboveBins> bins_{};
};

/// Lets view_set run on objects and counts after each of its views, for every view that is open; `options.run.views`
/// are looked at after each but the last. Surface is in voxels: points of the truth that the view would newly cover,
/// over the mean of a voxel with points. Nothing when `stop` was set before the end.
std::optional<OtherSideCount> count_other_sides(const std::vector<ExperimentObject>& objects,
                                                const MeasuredScenesOptions& options, const std::atomic<bool>& stop,
                                                std::ostream& terminal);

}  // namespace vantage
