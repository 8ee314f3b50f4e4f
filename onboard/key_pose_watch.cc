#include "onboard/key_pose_watch.h"

namespace vantage {

std::vector<KeyPose> KeyPoseWatch::corrections(tracking::Tracker* tracker, int piece,
                                               const Eigen::Isometry3d& T_world_map) {
  std::vector<KeyPose> corrected;
  for (View& view : views_) {
    const std::optional<Eigen::Isometry3d> T_map_camera = tracker->pose_of(view.key);
    if (!T_map_camera || tracker->piece_of(view.key) != piece) continue;
    const Eigen::Isometry3d now = T_world_map * *T_map_camera;
    const Eigen::Isometry3d change = view.T_world_camera.inverse() * now;
    if (change.translation().norm() < moved_m_ && Eigen::AngleAxisd(change.linear()).angle() < moved_rad_) continue;
    view.T_world_camera = now;
    corrected.push_back({view.utime, now});
  }
  return corrected;
}

}  // namespace vantage
