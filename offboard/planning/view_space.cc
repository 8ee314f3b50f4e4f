#include "offboard/planning/view_space.h"

#include <cmath>

#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"
#include "calib/look_at.h"

namespace vantage {

std::vector<CandidateView> cylinder_views(const CylinderViewsOptions& options) {
  const Eigen::Vector3d target = options.axis_foot + options.target_height_m * Eigen::Vector3d::UnitZ();
  std::vector<CandidateView> views;
  const auto add_ring = [&](double radius_m, double height_m) {
    for (int i = 0; i < options.azimuths; ++i) {
      const double azimuth = 2 * M_PI * i / options.azimuths;
      const Eigen::Vector3d offset(radius_m * std::cos(azimuth), radius_m * std::sin(azimuth), height_m);
      views.push_back({static_cast<std::int64_t>(views.size()), look_at(options.axis_foot + offset, target)});
    }
  };
  for (const double height_m : options.ring_heights_m) add_ring(options.radius_m, height_m);
  const double dome_centre_m = options.ring_heights_m.empty() ? 0 : options.ring_heights_m.back();
  for (const double elevation : options.dome_elevations_rad) {
    add_ring(options.radius_m * std::cos(elevation), dome_centre_m + options.radius_m * std::sin(elevation));
  }
  return views;
}

std::vector<CandidateView> views_within(std::span<const CandidateView> views, const Eigen::Vector3d& position,
                                        double way_m) {
  std::vector<CandidateView> within;
  for (const CandidateView& view : views) {
    if ((view.T_world_camera.translation() - position).norm() <= way_m) within.push_back(view);
  }
  return within;
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
