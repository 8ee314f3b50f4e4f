#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera_model.h"
#include "onboard/tracking/map.h"
#include "onboard/tracking/place_index.h"
#include "onboard/tracking/similarity.h"

namespace vantage::tracking {

struct LoopOptions {
  bool enabled = true;
  int least_matches = 25;  ///< landmarks that both places must share by look and by geometry
  int candidates = 4;      ///< places that are looked at closely
  int apart = 10;          ///< key frames that must lie between the two
  bool valid(std::string* why = nullptr) const;
};

/// The same place, seen by two key frames that the map does not know to be neighbours.
struct LoopMatch {
  KeyFrameId query = 0, place = 0;
  Similarity S_place_query;                              ///< maps points of the query's camera frame into the place's
  std::vector<std::pair<LandmarkId, LandmarkId>> pairs;  ///< of the place, of the query: the same points
};

/// Finds loops and says how much they are off.
class LoopCloser {
 public:
  LoopCloser(const CameraModel& camera, const LoopOptions& options) : camera_(camera), options_(options) {}

  /// Looks for a place that this key frame has seen before: by the index, then by descriptors, then by the similarity
  /// (Horn 1987, in RANSAC with a fixed seed) that brings the landmarks together in both images. `metric`: the scale is
  /// known to be one.
  std::optional<LoopMatch> find(const Map& map, const PlaceIndex& places, KeyFrameId query, bool metric) const;

 private:
  CameraModel camera_;
  LoopOptions options_;
};

}  // namespace vantage::tracking
