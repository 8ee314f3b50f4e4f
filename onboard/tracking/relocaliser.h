#pragma once

#include <optional>

#include "onboard/tracking/map_search.h"
#include "onboard/tracking/place_index.h"
#include "onboard/tracking/rotation_alignment.h"

namespace vantage::tracking {

struct Relocalised {
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  KeyFrameId place = 0;
  MapMatches matches;
  RefinedPose pose;
};

/// Where is this image in the map? Key frames that look alike (PlaceIndex), their landmarks by descriptor, the pose
/// from points (P3P in RANSAC with a fixed seed), then the usual search and refinement, which must find `least_inliers`
/// landmarks at their places. Where that finds nothing, the newest key frames are tried as a whole: the turn that
/// brings their small image onto this one (Klein and Murray 2008), then the same search. Nothing is taken on trust:
/// what looks alike and fits no pose is refused.
std::optional<Relocalised> relocalise(const CameraModel& camera, Map* map, const PlaceIndex& places,
                                      const ImagePyramid& image, MapSearch* search, RotationAlignment* rotation,
                                      int least_inliers = 30);

}  // namespace vantage::tracking
