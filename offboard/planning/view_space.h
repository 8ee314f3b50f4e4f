#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <Eigen/Geometry>

namespace vantage {

/// A pose from which the camera may look next.
struct CandidateView {
  std::int64_t id = 0;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// Rings of views on a cylinder with a half-sphere on top, all facing one point of the object's axis (paper.md, Section
/// IV-A; the defaults are the paper's 48 views).
struct CylinderViewsOptions {
  Eigen::Vector3d axis_foot{0, 0, 0};              ///< world, m: where the cylinder's axis meets the ground
  double radius_m = 0.6;                           ///< of the cylinder and the half-sphere
  std::vector<double> ring_heights_m{0.15, 0.35};  ///< above the foot; the half-sphere's centre is at the last one
  std::vector<double> dome_elevations_rad{0.7853981633974483};  ///< 45 degrees
  int azimuths = 16;                                            ///< views of a ring, the first at +x
  double target_height_m = 0.15;                                ///< above the foot: the point that all views face
};

/// Ids count up from 0: ring by ring from below, in a ring by azimuth (counter-clockwise seen from above).
std::vector<CandidateView> cylinder_views(const CylinderViewsOptions& options = {});

/// Those no farther than `way_m` from `position` (world, m) by a straight line, in their order.
std::vector<CandidateView> views_within(std::span<const CandidateView> views, const Eigen::Vector3d& position,
                                        double way_m);

/// Views of a file with lines "x y z qx qy qz qw" (T_world_camera); ids count up from 0 in the file's order.
/// \throws InputError naming file and line, also for a file without any view.
std::vector<CandidateView> read_views(const std::filesystem::path& path);

}  // namespace vantage
