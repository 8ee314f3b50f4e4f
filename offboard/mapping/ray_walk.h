#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

namespace vantage {

/// The part of the ray `origin + t direction`, t >= 0, inside the box [0, size]^3 (all in voxels).
/// False when it misses the box or a number is not finite. `direction` need not be a unit vector, but not zero.
inline bool clip_to_box(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Eigen::Vector3i& size,
                        double* t_enter, double* t_leave) {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    if (!(std::isfinite(origin[i]) && std::isfinite(direction[i]))) return false;
    if (direction[i] == 0) {
      if (!(origin[i] >= 0 && origin[i] < size[i])) return false;
      continue;
    }
    const double a = (0 - origin[i]) / direction[i], b = (size[i] - origin[i]) / direction[i];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  if (!(enter < leave) || leave == std::numeric_limits<double>::infinity()) return false;
  *t_enter = enter;
  *t_leave = leave;
  return true;
}

/// Walks the voxels of the box [0, size) that the ray meets, in order (Amanatides and Woo, "A fast voxel traversal
/// algorithm for ray tracing", 1987), in double precision. Coordinates in voxels; `direction` finite and not zero.
///
/// Calls `visit(const Eigen::Vector3i& voxel, double t_enter, double t_leave)` until it returns false or the ray has
/// left the box. Where two faces are crossed at once, x goes before y before z.
template <typename Visit>
void walk_ray(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Eigen::Vector3i& size,
              Visit&& visit) {
  double t = 0, t_leave = 0;
  if (!clip_to_box(origin, direction, size, &t, &t_leave)) return;
  const Eigen::Vector3d start = origin + t * direction;
  Eigen::Vector3i voxel, step;
  Eigen::Vector3d t_next, t_step;  // of the next face along each axis; between faces
  for (int i = 0; i < 3; ++i) {
    voxel[i] = std::clamp(static_cast<int>(std::floor(start[i])), 0, size[i] - 1);
    step[i] = direction[i] > 0 ? 1 : -1;
    const double face = voxel[i] + (direction[i] > 0 ? 1 : 0);
    const bool parallel = direction[i] == 0;
    t_step[i] = parallel ? std::numeric_limits<double>::infinity() : std::abs(1 / direction[i]);
    t_next[i] = parallel ? t_step[i] : (face - origin[i]) / direction[i];
  }
  while (true) {
    const int axis = t_next.x() <= t_next.y() ? (t_next.x() <= t_next.z() ? 0 : 2) : (t_next.y() <= t_next.z() ? 1 : 2);
    if (!visit(static_cast<const Eigen::Vector3i&>(voxel), t, t_next[axis])) return;
    t = t_next[axis];
    voxel[axis] += step[axis];
    if (voxel[axis] < 0 || voxel[axis] >= size[axis]) return;
    t_next[axis] += t_step[axis];
  }
}

}  // namespace vantage
