#pragma once

#include <atomic>
#include <filesystem>
#include <ostream>
#include <vector>

#include "offboard/experiment/measured_scenes.h"

namespace vantage {

struct LearningStatesOptions {
  MeasuredScenesOptions scenes;  ///< run.views: a state after each but the last; at most 64 candidates
  int runs = 4;                  ///< of each scene: in turns by random, half greedy on the truth, view_set
};

/// Writes for each object and seed `OUT/NAME-seedS.states`: what the map knew after each view of some runs, and which
/// points of the true surface each candidate covers; scripts/learn-surface-network reads it. All little-endian:
///
///     "VANTAGE-STATES-2"   16 bytes
///     uint32 channels, width, height, candidates, points, states
///     float32 mean number of points in a voxel that holds any
///     float32 x 3 position of each candidate, in voxels of the window
///     int32 voxel of each point (x + width (y + width z)), -1 outside the window
///     uint64 candidates that cover each point, a bit each
///     each state: uint64 candidates taken
///                 int8 x channels of each voxel (map_window.h)
///                 uint32 voxels that candidates are expected to see, and of each of them: uint32 voxel,
///                 uint8 x candidates: share that each would measure, of 255, as rays and angles tell (no lean)
///
/// False when `stop` was set before the end. \throws InputError when a file can't be written.
bool write_learning_states(const std::vector<ExperimentObject>& objects, const LearningStatesOptions& options,
                           const std::filesystem::path& out, const std::atomic<bool>& stop, std::ostream& terminal);

}  // namespace vantage
