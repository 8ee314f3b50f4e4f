#include "lcmtypes/link/depth_map.h"

#include <cmath>

namespace vantage {
namespace {

/// Largest entry of R R^T - I that still counts as a rotation; single-precision quaternions stay below 1e-6.
constexpr double kRotationTolerance = 1e-4;

bool usable(DepthState state) {
  return state == DepthState::kConverged || state == DepthState::kEdge || state == DepthState::kUpdating;
}

bool fail(std::string* why, std::string reason) {
  if (why != nullptr) *why = std::move(reason);
  return false;
}

}  // namespace

bool is_rigid(const Eigen::Isometry3d& pose) {
  if (!pose.matrix().allFinite()) return false;
  const Eigen::Matrix3d rotation = pose.linear();
  return (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRotationTolerance &&
         rotation.determinant() > 0;
}

bool DepthMap::valid(std::string* why) const {
  if (!camera.valid(why)) return false;
  if (camera.distortion != Distortion::kNone) return fail(why, "a depth map's camera must be without distortion");
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (depth_m.size() != pixels || sigma_m.size() != pixels || state.size() != pixels) {
    return fail(why, "the images have " + std::to_string(depth_m.size()) + ", " + std::to_string(sigma_m.size()) +
                         " and " + std::to_string(state.size()) + " pixels, the camera " +
                         std::to_string(camera.width) + " x " + std::to_string(camera.height));
  }
  if (!is_rigid(T_world_camera)) return fail(why, "the pose T_world_camera is not finite or not a rotation");
  for (std::size_t i = 0; i < pixels; ++i) {
    if (state[i] > DepthState::kDiverged) {
      return fail(
          why, "pixel " + std::to_string(i) + " has the unknown state " + std::to_string(static_cast<int>(state[i])));
    }
    if (usable(state[i]) &&
        !(std::isfinite(depth_m[i]) && depth_m[i] > 0 && std::isfinite(sigma_m[i]) && sigma_m[i] > 0)) {
      return fail(why, "pixel " + std::to_string(i) + " has depth " + std::to_string(depth_m[i]) + " m and sigma " +
                           std::to_string(sigma_m[i]) + " m; both must be positive");
    }
  }
  return true;
}

}  // namespace vantage
