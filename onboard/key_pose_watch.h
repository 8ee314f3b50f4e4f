#pragma once

#include <cstdint>
#include <vector>

#include "onboard/executive/view_depth.h"
#include "onboard/tracking/tracker.h"

namespace vantage {

/// Follows where the key frames of finished depth maps stand while tracking corrects its map.
class KeyPoseWatch {
 public:
  /// A correction by less than both is not told.
  KeyPoseWatch(double moved_m, double moved_rad) : moved_m_(moved_m), moved_rad_(moved_rad) {}

  /// A depth map was said to stand at `T_world_camera`; `key` is what tracking made of its key frame.
  void add(std::int64_t utime, const tracking::TrackingResult& key, const Eigen::Isometry3d& T_world_camera) {
    views_.push_back({utime, key, T_world_camera});
  }

  /// Those of the given piece of map that now stand elsewhere than was said last. `T_world_map` leads from tracking's
  /// world to the robot's.
  std::vector<KeyPose> corrections(tracking::Tracker* tracker, int piece, const Eigen::Isometry3d& T_world_map);

 private:
  struct View {
    std::int64_t utime;
    tracking::TrackingResult key;
    Eigen::Isometry3d T_world_camera;
  };

  double moved_m_, moved_rad_;
  std::vector<View> views_;
};

}  // namespace vantage
