#pragma once

#include <vector>

#include "onboard/tracking/landmark_search.h"
#include "onboard/tracking/pose_refinement.h"

namespace vantage::tracking {

struct MapSearchOptions {
  int cells_across = 22;  ///< columns of the grid; one landmark is sought successfully in each cell
  int most_matches = 170;
  double seed_spread_px = 2.5;   ///< a seed whose place is less certain than this is sought along its epipolar line ...
  double widest_spread_px = 40;  ///< ... up to this, and ...
  int enough_matches = 100;      ///< ... only when the others are fewer
  bool valid(std::string* why = nullptr) const;
};

/// The landmarks of some key frames as an image shows them.
struct MapMatches {
  std::vector<Feature> features;
  std::vector<PoseMeasurement> measurements;  ///< one a feature, in the same order
  int visible = 0;                            ///< cells that had something to seek
  int found = 0;                              ///< cells where a converged landmark was found
};

/// Reprojects landmarks into an image and aligns their patches: one success a cell of a grid, converged ones before
/// seeds, those often found first. Keeps its memory.
class MapSearch {
 public:
  MapSearch(const CameraModel& camera, const MapSearchOptions& options = {});

  /// Notes on every landmark that it was sought and whether it was found, unless `note` is false.
  void run(Map* map, const std::vector<KeyFrameId>& key_frames, const ImagePyramid& current,
           const Eigen::Isometry3d& T_current_world, MapMatches* matches, bool note = true);

 private:
  struct Candidate {
    Landmark* landmark;
    double rank;  ///< negative: to be sought along its epipolar line
  };
  void add(const Map& map, const Landmark& landmark, const Feature& feature, MapMatches* matches) const;

  CameraModel camera_;
  MapSearchOptions options_;
  int cell_px_ = 1, columns_ = 1, rows_ = 1;
  std::vector<std::vector<Candidate>> cells_;
  std::vector<std::size_t> order_;  // of the cells: scattered, so that a limit does not cut off one side
};

}  // namespace vantage::tracking
