#include "offboard/planning/view_space.h"

#include <cmath>

#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"

namespace vantage {

Eigen::Isometry3d facing(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  constexpr double kVertical = 1e-9;
  const Eigen::Vector3d z = (target - eye).normalized();
  Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ());
  x = x.norm() < kVertical ? Eigen::Vector3d(0, -1, 0) : x.normalized();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << x, z.cross(x), z;
  pose.translation() = eye;
  return pose;
}

std::vector<CandidateView> cylinder_views(const CylinderViewsOptions& options) {
  const Eigen::Vector3d target = options.axis_foot + options.target_height_m * Eigen::Vector3d::UnitZ();
  std::vector<CandidateView> views;
  const auto add_ring = [&](double radius_m, double height_m) {
    for (int i = 0; i < options.azimuths; ++i) {
      const double azimuth = 2 * M_PI * i / options.azimuths;
      const Eigen::Vector3d offset(radius_m * std::cos(azimuth), radius_m * std::sin(azimuth), height_m);
      views.push_back({static_cast<std::int64_t>(views.size()), facing(options.axis_foot + offset, target)});
    }
  };
  for (const double height_m : options.ring_heights_m) add_ring(options.radius_m, height_m);
  const double dome_centre_m = options.ring_heights_m.empty() ? 0 : options.ring_heights_m.back();
  for (const double elevation : options.dome_elevations_rad) {
    add_ring(options.radius_m * std::cos(elevation), dome_centre_m + options.radius_m * std::sin(elevation));
  }
  return views;
}

std::vector<CandidateView> read_views(const std::filesystem::path& path) {
  std::vector<CandidateView> views;
  for (const Eigen::Isometry3d& pose : read_pose_list(path)) {
    views.push_back({static_cast<std::int64_t>(views.size()), pose});
  }
  if (views.empty()) throw InputError(path.string() + ": holds no view; expected lines \"x y z qx qy qz qw\"");
  return views;
}

}  // namespace vantage
